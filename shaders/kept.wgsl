// Writes the chosen samples of all rays one behind the other, with what compositing and colour need.
// Needs: counters, density.

var<storage, read> counters: Counters;
tensor<read> samples: vec4<f32>;
tensor<read> density_out: vec4<f32>;
var<storage, read> ray_spans: array<vec2<u32>>;
var<storage, read> kept_spans: array<vec2<u32>>;
tensor<read> chosen: vec4<f32>;
// Sample and ray.
tensor<write> kept_rows: vec2<u32>;
// Log-density, step length, and optical depth left out in front of it.
tensor<write> kept_steps: vec4<f32>;
// Gains in both estimates.
tensor<write> kept_gains: vec2<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays_used {
        return;
    }
    let first = ray_spans[index].x;
    let span = kept_spans[index];
    for (var i = 0u; i < span.y; i++) {
        let choice = chosen_load(first + i);
        let sample = u32(choice.x);
        kept_rows_store(span.x + i, vec2(sample, index));
        let log_density = density_log(density_out_load(sample * DENSITY_QUADS).x);
        kept_steps_store(span.x + i, vec4(log_density, samples_load(sample).w, choice.y, 0.0));
        kept_gains_store(span.x + i, choice.zw);
    }
}
