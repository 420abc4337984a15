// The fused kernel: renders a ray, takes its loss, and walks back once for the gradients of colours and
// log-densities. Section 2 of the design; the same formulas as `reference::composite`.
// Needs: counters, exp, transmittance, weights.

var<storage, read> counters: Counters;
var<storage, read> kept_spans: array<vec2<u32>>;
// Log-density and step length.
tensor<read> kept_steps: vec4<f32>;
tensor<read> color: vec4<f32>;
var<storage, read> targets: array<vec4<f32>>;
var<storage, read> backgrounds: array<vec4<f32>>;
// Colour over the background, and opacity.
var<storage, read_write> rendered: array<vec4<f32>>;
// Squared errors of the four channels.
var<storage, read_write> ray_errors: array<vec4<f32>>;
// dL/dc in rgb and dL/ds in w. Between the walks it holds tau and T of each sample.
tensor<read_write> d_color: vec4<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays_used {
        return;
    }
    let span = kept_spans[index];
    let background = vec4(backgrounds[index].rgb, 0.0);
    var depth = 0.0;
    // What rounding took from `depth`: long rays would lose it.
    var lost = 0.0;
    var sum = vec4(0.0);
    for (var i = span.x; i < span.x + span.y; i++) {
        let step = kept_steps_load(i);
        let tau = optical_depth(step.x, step.y);
        let transmittance = transmittance_at(depth, tau);
        let weight = transmittance * opacity(tau);
        weight_store(i, weight);
        sum += weight * vec4(color_load(i).rgb, 1.0);
        d_color_store(i, vec4(tau, transmittance, 0.0, 0.0));
        let term = tau - lost;
        let next = depth + term;
        lost = (next - depth) - term;
        depth = next;
    }
    let unblocked = exp_accurate(-depth);
    let result = sum + unblocked * background;
    let error = result - targets[index];
    rendered[index] = result;
    ray_errors[index] = error * error;

    let d_result = error / (2.0 * f32(counters.rays_used));
    var behind = background;
    for (var i = span.x + span.y; i > span.x; i--) {
        let known = d_color_load(i - 1u);
        let alpha = opacity(known.x);
        let through = passing(known.x, alpha);
        let own = vec4(color_load(i - 1u).rgb, 1.0);
        let d_result_d_s = d_log_density(known.x, alpha, through, known.y, own, behind);
        d_color_store(i - 1u, vec4(d_result.rgb * known.y * alpha, dot(d_result, d_result_d_s)));
        behind = seen_through(alpha, through, own, behind);
    }
}
