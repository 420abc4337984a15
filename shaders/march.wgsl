// Marks the steps of each ray that lie in occupied cells: one bit per step, and their number.
// needs: counters, extent, group, march_start, occupancy, ray_load, stepping

tensor<read> occupancy_bits: u32;
var<storage, read_write> ray_steps: array<u32>;
// First sample (written by the scan) and number of samples.
var<storage, read_write> ray_spans: array<vec2<u32>>;

fn occupied(position: vec3<f32>, cascade: u32) -> bool {
    let index = cell_around(position, cascade);
    return ((occupancy_bits_load(index >> 5u) >> (index & 31u)) & 1u) == 1u;
}

// Distance from `position` to where the ray leaves its cell.
fn distance_through_cell(position: vec3<f32>, direction: vec3<f32>, cascade: u32) -> f32 {
    let at = cascade_position(position, cascade);
    let wall = floor(at) + select(vec3(0.0), vec3(1.0), direction > vec3(0.0));
    let speed = select(direction, vec3(1e-12), abs(direction) < vec3(1e-12));
    let steps = abs((wall - at) / speed);
    return min(steps.x, min(steps.y, steps.z)) * cascade_side(cascade) / f32(CELLS);
}

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays {
        return;
    }
    let ray = ray_load(index);
    let first = march_start(ray, index);
    var count = 0u;
    var word = 0u;
    var i = extent_begin(index);
    var word_index = i >> 5u;
    let most = extent_most();
    while i < MAX_STEPS && count < most {
        let t = stepping_distance(first + f32(i));
        // Written so that anything not a number ends the ray.
        if !(t < ray.t_far) {
            i = MAX_STEPS;
            break;
        }
        let position = ray.origin + t * ray.direction;
        let cascade = cascade_at(position);
        var next = i + 1u;
        if occupied(position, cascade) {
            word |= 1u << (i & 31u);
            count++;
        } else {
            let exit = stepping_index(t + distance_through_cell(position, ray.direction, cascade));
            next = max(next, u32(clamp(ceil(exit - first), 0.0, f32(MAX_STEPS))));
        }
        while word_index < min(next >> 5u, STEP_WORDS) {
            ray_steps[index * STEP_WORDS + word_index] = word;
            word = 0u;
            word_index++;
        }
        i = next;
    }
    if word != 0u {
        ray_steps[index * STEP_WORDS + word_index] = word;
    }
    ray_spans[index] = vec2(0u, count);
    extent_end(index, i);
}
