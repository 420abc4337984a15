// Writes the chosen samples of all rays one behind the other, with what compositing and colour need.
// Needs: counters, density.

var<storage, read> counters: Counters;
var<storage, read> samples: array<vec4<f32>>;
var<storage, read> density_out: array<f32>;
var<storage, read> ray_spans: array<vec2<u32>>;
var<storage, read> kept_spans: array<vec2<u32>>;
var<storage, read> chosen: array<vec2<u32>>;
var<storage, read_write> kept_sample: array<u32>;
var<storage, read_write> kept_ray: array<u32>;
var<storage, read_write> kept_gain: array<f32>;
// Log-density and step length.
var<storage, read_write> kept_steps: array<vec2<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays_used {
        return;
    }
    let first = ray_spans[index].x;
    let span = kept_spans[index];
    for (var i = 0u; i < span.y; i++) {
        let choice = chosen[first + i];
        kept_sample[span.x + i] = choice.x;
        kept_ray[span.x + i] = index;
        kept_gain[span.x + i] = bitcast<f32>(choice.y);
        let log_density = density_log(density_out[choice.x * DENSITY_OUTPUTS]);
        kept_steps[span.x + i] = vec2(log_density, samples[choice.x].w);
    }
}
