// The fused kernel: renders a ray, takes its loss, and walks back once for the gradients of colours and
// log-densities. Section 2 of the design; the same formulas as `reference::composite`.
// Needs: counters, exp, sum, transmittance, loss, depth_loss, distortion, weights.

var<storage, read> counters: Counters;
var<storage, read> kept_spans: array<vec2<u32>>;
// Log-density, step length, optical depth left out in front of the sample, and gain: how many times its own weight its
// colour has.
tensor<read> kept_steps: vec4<f32>;
// Optical depth behind the last kept sample.
var<storage, read> ray_tails: array<f32>;
tensor<read> color: vec4<f32>;
var<storage, read> targets: array<vec4<f32>>;
var<storage, read> backgrounds: array<vec4<f32>>;
// Colour over the background, and opacity.
var<storage, read_write> rendered: array<vec4<f32>>;
// Squared errors of the four channels with their weights; opacity's also holds what the depth adds.
var<storage, read_write> ray_errors: array<vec4<f32>>;
// dL/dc in rgb and dL/ds in w. Between the walks it holds tau and the root of T of each
// sample, and what the distortion sums up in front of it.
tensor<read_write> d_color: vec4<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays_used {
        return;
    }
    let span = kept_spans[index];
    let end = span.x + span.y;
    let background = vec4(backgrounds[index].rgb, 0.0);
    // There are fewer than 2^31 samples.
    let zero = span.x >> 31u;
    let tail = ray_tails[index];
    var depth = sum_of(vec4(0.0));
    var sum = sum_of(vec4(0.0));
    var distance = depth_begin(index);
    var spread = spread_begin(index);
    for (var i = span.x; i < end; i++) {
        let step = kept_steps_load(i);
        depth = sum_add(depth, vec4(step.z), zero);
        let tau = optical_depth(step.x, step.y);
        let root = exp_accurate(-0.5 * transmittance_depth(depth.value.x, tau));
        let alpha = opacity(tau);
        let own = vec4(color_load(i).rgb, 1.0);
        weight_store(i, root * (root * alpha));
        sum = sum_add(sum, squared_times(root, step.w * alpha * own), zero);
        distance = depth_forward(distance, i, root, step.w * alpha, zero);
        d_color_store(i, vec4(tau, root, spread_before(spread)));
        spread = spread_forward(spread, i, root * (root * step.w * alpha));
        depth = sum_add(depth, vec4(tau), zero);
    }
    let result = sum.value + squared_times(exp_accurate(-0.5 * (depth.value.x + tail)), background);
    let error = result - targets[index];
    let weight = loss_weight(result, targets[index]);
    rendered[index] = result;
    ray_errors[index] = weight * error * error + vec4(0.0, 0.0, 0.0, depth_squared_error(distance) + spread_error(spread));

    let d_result = weight * error / (2.0 * f32(counters.rays_used));
    distance = depth_turn(distance);
    spread = spread_turn(spread);
    var behind = sum_of(exp_accurate(-tail) * background);
    var missing = opacity(tail);
    for (var i = end; i > span.x; i--) {
        let known = d_color_load(i - 1u);
        let step = kept_steps_load(i - 1u);
        let part = passage(known.x, step.z, step.w);
        let color = vec4(color_load(i - 1u).rgb, 1.0);
        let by_color = dot(d_result, gradient_color(part.alpha, color, behind) - missing * color);
        let sample_weight = known.y * (known.y * step.w * part.alpha);
        let by_depth = depth_gradient(distance, i - 1u, part.alpha, missing);
        let by_spread = spread_gradient(spread, i - 1u, known.zw, sample_weight, part.alpha, missing);
        let d_s = step.w * part.tau * (by_color + by_depth + by_spread);
        let d_c = squared_times(known.y, step.w * part.alpha * d_result).rgb;
        let root = gradient_root(known.y, part.passing_root);
        d_color_store(i - 1u, vec4(d_c, root * (root * d_s)));
        distance = depth_backward(distance, i - 1u, part, zero);
        spread = spread_backward(spread, i - 1u, known.zw, sample_weight, part, zero);
        behind = behind_next(behind, color, part, zero);
        missing = missing_next(missing, part);
    }
}

// What a kept sample and those left out in front of it do to what is seen through them.
struct Passage {
    tau: f32,
    alpha: f32,
    passing_root: f32,
    // What the sample's colour counts beyond alpha, and what is taken from the colour behind beyond alpha of it, seen
    // from the far end of the kept sample in front. Both are 0 where nothing was left out.
    excess: f32,
    taken: f32,
}

fn passage(tau: f32, gap: f32, gain: f32) -> Passage {
    let alpha = opacity(tau);
    let passing_root = exp_accurate(-0.5 * tau);
    let excess = alpha * ((gain - 1.0) * exp_accurate(-gap) - opacity(gap));
    return Passage(tau, alpha, passing_root, excess, passing_root * passing_root * opacity(gap));
}

// What is seen from in front of a sample, from its colour and what is seen from just behind it.
fn behind_next(behind: Sum, color: vec4<f32>, part: Passage, zero: u32) -> Sum {
    let own = own_color(part.passing_root, color);
    let left_out = part.excess * color - part.taken * behind.value;
    // e^-tau rounds, and would wear out the B of many thin samples.
    let difference = sum_below(own, behind);
    if part.tau < 0.35 {
        return sum_add(sum_add(behind, part.alpha * difference, zero), left_out, zero);
    }
    return sum_add(sum_add(sum_of(own), -squared_times(part.passing_root, difference), zero), left_out, zero);
}

// The part of the opacity behind a sample that no kept sample stands for.
fn missing_next(missing: f32, part: Passage) -> f32 {
    let passing = part.passing_root * part.passing_root - part.taken;
    return part.taken - part.excess + passing * missing;
}
