// Provides: the threads of a workgroup of all kernels over counts that the device knows.

const GROUP_SIZE = 64u;
// Threads that share a ray, where its samples do not wait for one another. Such a workgroup has so many for each of its
// GROUP_SIZE rays, those of a ray side by side.
const RAY_LANES = 4u;

// Workgroups over `count` things, several per thread.
fn workgroups(count: u32, per_thread: u32) -> vec3<u32> {
    let per_group = GROUP_SIZE * per_thread;
    return vec3(max((count + per_group - 1u) / per_group, 1u), 1u, 1u);
}

// The number of a thread of a dispatch that may have several rows of workgroups.
fn wide_index(id: vec3<u32>) -> u32 {
    return id.x + id.y * GROUP_COLUMNS * GROUP_SIZE;
}
