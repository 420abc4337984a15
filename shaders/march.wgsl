// Marks the steps of each ray that lie in occupied cells: one bit per step, and their number. Several threads may share a
// ray: they take its words in turn.
// needs: counters, extent, group, march_start, ray_load, space

tensor<read> occupancy_bits: u32;
var<storage, read_write> ray_steps: array<u32>;
// First sample (written by the scan) and number of samples.
var<storage, read_write> ray_spans: array<vec2<u32>>;
var<workgroup> counts: array<u32, GROUP_SIZE * MARCH_LANES>;

fn occupied(cell: u32) -> bool {
    return ((occupancy_bits_load(cell >> 5u) >> (cell & 31u)) & 1u) == 1u;
}

// Marks the steps of a thread's words; returns their number.
fn march(index: u32, lane: u32) -> u32 {
    let ray = ray_load(index);
    let first = march_start(ray, index);
    var count = 0u;
    var word = 0u;
    var i = extent_begin(index) + lane * 32u;
    var word_index = i >> 5u;
    let most = extent_most();
    while i < MAX_STEPS && count < most {
        let t = space_step_distance(first + f32(i));
        // Written so that anything not a number ends the ray.
        if !(t < ray.t_far) {
            i = MAX_STEPS;
            break;
        }
        let position = ray_at(ray, t);
        var next = i + 1u;
        if occupied(space_cell(space_in_grid(position))) {
            word |= 1u << (i & 31u);
            count++;
        } else {
            let exit = space_step_index(t + space_cell_exit(position, ray.direction));
            next = max(next, u32(clamp(ceil(exit - first), 0.0, f32(MAX_STEPS))));
        }
        while word_index < min(next >> 5u, STEP_WORDS) {
            ray_steps[index * STEP_WORDS + word_index] = word;
            word = 0u;
            word_index += MARCH_LANES;
        }
        i = max(next, 32u * word_index);
    }
    if word != 0u {
        ray_steps[index * STEP_WORDS + word_index] = word;
    }
    extent_end(index, i);
    return count;
}

@compute @workgroup_size(GROUP_SIZE, MARCH_LANES)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let index = group.x * GROUP_SIZE + thread / MARCH_LANES;
    let lane = thread % MARCH_LANES;
    let is_ray = index < counters.rays;
    var count = 0u;
    if is_ray {
        count = march(index, lane);
    }
    if MARCH_LANES > 1u {
        counts[thread] = count;
        workgroupBarrier();
    }
    if !is_ray || lane != 0u {
        return;
    }
    for (var other = 1u; other < MARCH_LANES; other++) {
        count += counts[thread + other];
    }
    ray_spans[index] = vec2(0u, count);
}
