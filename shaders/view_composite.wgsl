// Renders the rays of a view: colour, opacity and mean depth as its lens defines it.
// Needs: counters, camera, lens, exp, sum, transmittance.

var<storage, read> counters: Counters;
var<storage, read> cameras: array<Camera>;
tensor<read> samples: vec4<f32>;
var<storage, read> kept_spans: array<vec2<u32>>;
tensor<read> kept_rows: vec2<u32>;
tensor<read> kept_steps: vec4<f32>;
tensor<read> color: vec4<f32>;
// Premultiplied colour without background, and opacity.
var<storage, read_write> view_color: array<vec4<f32>>;
// In box units; 0 where the opacity is below 1e-3.
var<storage, read_write> view_depth: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays_used {
        return;
    }
    let span = kept_spans[index];
    let camera = cameras[0];
    var depth = 0.0;
    var sum = vec4(0.0);
    var distance = 0.0;
    for (var i = span.x; i < span.x + span.y; i++) {
        let step = kept_steps_load(i);
        let tau = optical_depth(step.x, step.y);
        depth += step.z;
        let weight = step.w * exp_accurate(-transmittance_depth(depth, tau)) * opacity(tau);
        sum += weight * vec4(color_load(i).rgb, 1.0);
        distance += weight * lens_depth(camera, samples_load(kept_rows_load(i).x).xyz - camera.origin);
        depth += tau;
    }
    view_color[index] = sum;
    view_depth[index] = select(0.0, distance / max(sum.a, 1e-6), sum.a >= 1e-3);
}
