// Marks the steps of each ray that lie in occupied cells: one bit per step, and their number.
// needs: counters, extent, group, march_start, ray_load, space

tensor<read> occupancy_bits: u32;
var<storage, read_write> ray_steps: array<u32>;
// First sample (written by the scan) and number of samples.
var<storage, read_write> ray_spans: array<vec2<u32>>;

fn occupied(cell: u32) -> bool {
    return ((occupancy_bits_load(cell >> 5u) >> (cell & 31u)) & 1u) == 1u;
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
