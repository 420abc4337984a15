// Provides: the steps of a ray that are marched at once: those of a round, from where the round before ended up to
// `progress.quota` samples. A ray whose next step is MAX_STEPS has none left. Needs: progress.

var<storage, read> progress: Progress;
// Steps of each ray: the first of this round, and the first of the next.
var<storage, read_write> ray_rounds: array<vec2<u32>>;

// The first step to march, and the first of those that were marched.
fn extent_begin(index: u32) -> u32 {
    return ray_rounds[index].y;
}

fn extent_first(index: u32) -> u32 {
    return ray_rounds[index].x;
}

// Most samples of a ray.
fn extent_most() -> u32 {
    return progress.quota;
}

// Marching ended in front of step `next`; MAX_STEPS where it left the box.
fn extent_end(index: u32, next: u32) {
    ray_rounds[index] = vec2(ray_rounds[index].y, next);
}
