// Decides which samples of a ray get colour and gradients. A sample of weight w is kept with probability
// p = clamp(w / WEIGHT_FLOOR, KEEP_PROBABILITY, 1) and then stands for 1/p samples: its step becomes 1/p as long.
// One random number per ray spreads the choices evenly along it. Nothing is kept behind the point where the ray
// is opaque; see `reference::selection`.
// Needs: random, step, counters, exp, density.

var<storage, read> counters: Counters;
tensor<read> samples: vec4<f32>;
tensor<read> density_out: vec4<f32>;
var<storage, read> ray_spans: array<vec2<u32>>;
var<storage, read_write> kept_spans: array<vec2<u32>>;
// The chosen samples of ray r from index ray_spans[r].x on: sample, and 1/p as bits.
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
    var share = random_f32(step.stream, index, RANDOM_SELECTION);
    for (var i = span.x; i < span.x + span.y; i++) {
        let tau = optical_depth(density_log(density_out_load(i * DENSITY_QUADS).x), samples_load(i).w);
        let weight = transmittance * opacity(tau);
        let probability = clamp(weight / WEIGHT_FLOOR, KEEP_PROBABILITY, 1.0);
        share += probability;
        if share >= 1.0 {
            share -= 1.0;
            chosen_store(span.x + count, vec2(i, bitcast<u32>(1.0 / probability)));
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
