// Decides which samples of a ray get colour and gradients: all that matter, one in several of the others, and
// none behind the point where the ray is opaque; see `reference::selection`.
// Needs: random, step, counters, exp, activation.

var<storage, read> counters: Counters;
tensor<read> samples: vec4<f32>;
tensor<read> density_out: vec4<f32>;
var<storage, read> ray_spans: array<vec2<u32>>;
var<storage, read_write> kept_spans: array<vec2<u32>>;
// The chosen samples of ray r from index ray_spans[r].x on: sample, and gain as bits.
tensor<write> chosen: vec2<u32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays_used {
        return;
    }
    let span = ray_spans[index];
    var depth = 0.0;
    var transmittance = 1.0;
    var count = 0u;
    for (var i = span.x; i < span.x + span.y; i++) {
        let tau = optical_depth(density_log(density_out_load(i * DENSITY_QUADS).x), samples_load(i).w);
        let weight = transmittance * opacity(tau);
        var gain = 1.0;
        if weight < WEIGHT_FLOOR {
            gain = 0.0;
            if random_f32(step.stream, i, RANDOM_SELECTION) < KEEP_PROBABILITY {
                gain = 1.0 / KEEP_PROBABILITY;
            }
        }
        if gain > 0.0 {
            chosen_store(span.x + count, vec2(i, bitcast<u32>(gain)));
            count++;
        }
        depth += tau;
        transmittance = exp_accurate(-depth);
        if transmittance < STOP_TRANSMITTANCE {
            break;
        }
    }
    kept_spans[index] = vec2(0u, count);
}
