// Writes the marked steps of each ray as samples: where the hash grid has them, and the length of the step.
// needs: counters, distance, extent, group, march_start, ray_load, space

var<storage, read> ray_steps: array<u32>;
var<storage, read> ray_spans: array<vec2<u32>>;
// Position in the hash grid, and the step's length in units of the inner cube's side.
tensor<write> samples: vec4<f32>;

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays_used {
        return;
    }
    let span = ray_spans[index];
    if span.y == 0u {
        return;
    }
    let ray = ray_load(index);
    let first = march_start(ray, index);
    var written = 0u;
    var word_index = extent_first(index) >> 5u;
    while written < span.y && word_index < STEP_WORDS {
        var word = ray_steps[index * STEP_WORDS + word_index];
        while word != 0u && written < span.y {
            let u = first + f32(word_index * 32u + countTrailingZeros(word));
            word &= word - 1u;
            let t = space_step_distance(u);
            let delta = space_step_length(u) * DENSITY_SCALE;
            samples_store(span.x + written, vec4(space_in_grid(ray_at(ray, t)), delta));
            distance_store(span.x + written, ray, t);
            written++;
        }
        word_index++;
    }
}
