// Adds the samples of a round to the optical depth, opacity and depth of a view's rays, and decides which of them get
// colour: wherever the weights since the last one sum to COLOR_WEIGHT. That sample's colour stands for theirs. A ray
// ends where it is opaque or leaves the box.
// needs: counters, density, distance, exp, group, transmittance

tensor<read> samples: vec4<f32>;
tensor<read> density_out: vec4<f32>;
var<storage, read> ray_spans: array<vec2<u32>>;
// As `view_rays` begins them.
tensor<read_write> ray_states: vec4<f32>;
var<storage, read_write> kept_spans: array<vec2<u32>>;
// The samples with colour of ray r from index ray_spans[r].x on: sample (as a number), and the weight it stands for.
tensor<write> chosen: vec4<f32>;
// 1 where the slot's ray ended, which marching tells of those that leave the box.
var<storage, read_write> view_slots: array<vec2<u32>>;

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays_used {
        return;
    }
    let span = ray_spans[index];
    let state = ray_states_load(2u * index);
    var depth = state.x;
    var alpha = state.y;
    var pending = state.z;
    var distance = state.w;
    var count = 0u;
    var ended = view_slots[index].y == 1u;
    var i = span.x;
    while i < span.x + span.y {
        let sample = samples_load(i);
        let tau = optical_depth(density_log(density_out_load(i * DENSITY_QUADS).x), sample.w);
        let weight = exp_accurate(-transmittance_depth(depth, tau)) * opacity(tau);
        alpha += weight;
        pending += weight;
        distance += weight * sample_distance(i);
        if pending >= COLOR_WEIGHT {
            chosen_store(span.x + count, vec4(f32(i), pending, 0.0, 0.0));
            count++;
            pending = 0.0;
        }
        depth += tau;
        i++;
        if exp_accurate(-depth) < STOP_TRANSMITTANCE {
            ended = true;
            break;
        }
    }
    // What is left takes the mean colour of the ray; where there is none yet, that of the last sample.
    if ended && i > span.x && pending > 0.0 && pending == alpha {
        chosen_store(span.x, vec4(f32(i - 1u), pending, 0.0, 0.0));
        count = 1u;
        pending = 0.0;
    }
    ray_states_store(2u * index, vec4(depth, alpha, pending, distance));
    kept_spans[index] = vec2(0u, count);
    view_slots[index] = vec2(0u, u32(ended));
}
