// The fused kernel: renders a ray, takes its loss, and walks back once for the gradients of colours and
// log-densities. Section 2 of the design; the same formulas as `reference::composite`.
//
// Where samples were left out, the ray's colour is known by two estimates that know nothing of each other, and its
// squared error is their product: (R' - g)(R'' - g), whose mean is the square of the mean error. The square of a single
// estimate would hold its variance too, and gradients would make rays opaque too early, where nothing is left out. A
// whole ray has one colour, and both are that.
// needs: counters, depth_loss, distortion, exp, group, kept_load, loss, ray_result, ray_target, sparsity, sum, transmittance, weights

var<storage, read> kept_spans: array<vec2<u32>>;
// Optical depth behind the last kept sample.
var<storage, read> ray_tails: array<f32>;
tensor<read> color: vec4<f32>;
var<storage, read> ray_targets: array<RayTarget>;
var<storage, read_write> ray_results: array<RayResult>;
// dL/dc in rgb and dL/ds in w. Between the walks it holds tau and the root of T of each
// sample, and what the distortion sums up in front of it.
tensor<read_write> d_color: vec4<f32>;

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays_used {
        return;
    }
    let span = kept_spans[index];
    let end = span.x + span.y;
    let ray = ray_targets[index];
    let background = vec4(ray.background, 0.0);
    // There are fewer than 2^31 samples.
    let zero = span.x >> 31u;
    let tail = ray_tails[index];
    var depth = sum_of(vec4(0.0));
    var sums = array(sum_of(vec4(0.0)), sum_of(vec4(0.0)));
    var distance = depth_begin(ray.depth);
    var spread = spread_begin();
    var sparsity = 0.0;
    var next = seen_load(span.x);
    for (var i = span.x; i < end; i++) {
        let kept = next.step;
        let gains = next.gains;
        let own = vec4(next.color, 1.0);
        next = seen_load(i + 1u);
        depth = sum_add(depth, vec4(kept.z), zero);
        let tau = optical_depth(kept.x, kept.y);
        let root = exp_accurate(-0.5 * transmittance_depth(depth.value.x, tau));
        let alpha = opacity(tau);
        weight_store(i, root * (root * alpha));
        sums[0] = sum_add(sums[0], squared_times(root, gains.x * alpha * own, zero), zero);
        sums[1] = sum_add(sums[1], squared_times(root, gains.y * alpha * own, zero), zero);
        let gain = 0.5 * (gains.x + gains.y);
        distance = depth_forward(distance, i, root, gain * alpha, zero);
        d_color_store(i, vec4(tau, root, spread_before(spread)));
        spread = spread_forward(spread, i, root * (root * gain * alpha));
        sparsity += sparsity_error(i, root, gain);
        depth = sum_add(depth, vec4(tau), zero);
    }
    let through = squared_times(exp_accurate(-0.5 * (depth.value.x + tail)), background, zero);
    let first = sums[0].value + through;
    let second = sums[1].value + through;
    let result = 0.5 * (first + second);
    let errors = array(first - ray.color, second - ray.color);
    let weight = loss_weight(result, ray.color);
    let further = depth_squared_error(distance) + spread_error(spread) + sparsity;
    ray_results[index] = RayResult(result, weight * errors[0] * errors[1] + vec4(0.0, 0.0, 0.0, further));

    // dL/dR of each estimate, of which the error of the other is a factor.
    let share = weight / (4.0 * f32(counters.rays_used));
    let d_results = array(share * errors[1], share * errors[0]);
    distance = depth_turn(distance);
    spread = spread_turn(spread);
    let last_behind = sum_of(exp_accurate(-tail) * background);
    var behind = array(last_behind, last_behind);
    var missing = vec2(opacity(tail));
    next = seen_load(max(end, 1u) - 1u);
    var next_known = d_color_load(max(end, 1u) - 1u);
    for (var i = end; i > span.x; i--) {
        let known = next_known;
        let gains = next.gains;
        let gain = 0.5 * (gains.x + gains.y);
        let part = passage(known.x, next.step.z, gain);
        let color = vec4(next.color, 1.0);
        next = seen_load(max(i, 2u) - 2u);
        next_known = d_color_load(max(i, 2u) - 2u);
        let alpha = part.alpha;
        let first = dot(d_results[0], gradient_color(alpha, color, behind[0]) - missing.x * color);
        let second = dot(d_results[1], gradient_color(alpha, color, behind[1]) - missing.y * color);
        let sample_weight = known.y * (known.y * gain * alpha);
        let mean_missing = 0.5 * (missing.x + missing.y);
        let by_depth = depth_gradient(distance, i - 1u, alpha, mean_missing);
        let by_spread = spread_gradient(spread, i - 1u, known.zw, sample_weight, alpha, mean_missing);
        let d_s = part.tau * (gains.x * first + gains.y * second + gain * (by_depth + by_spread));
        let d_c = squared_times(known.y, alpha * (gains.x * d_results[0] + gains.y * d_results[1]), zero).rgb;
        let root = gradient_root(known.y, part.passing_root);
        let d_density = squared_times(root, vec4(d_s), zero).x;
        d_color_store(i - 1u, vec4(d_c, d_density + sparsity_gradient(i - 1u, known.y, gain)));
        distance = depth_backward(distance, i - 1u, part, zero);
        spread = spread_backward(spread, i - 1u, known.zw, sample_weight, part, zero);
        let parts = array(with_gain(part, gains.x), with_gain(part, gains.y));
        behind = array(behind_next(behind[0], color, parts[0], zero), behind_next(behind[1], color, parts[1], zero));
        missing = vec2(missing_next(missing.x, parts[0]), missing_next(missing.y, parts[1]));
    }
}

// What is read of a kept sample: the next one's while this one is worked on.
struct Seen {
    step: vec4<f32>,
    gains: vec2<f32>,
    color: vec3<f32>,
}

fn seen_load(i: u32) -> Seen {
    return Seen(kept_step(i), kept_gains(i), color_load(i).rgb);
}

// What a kept sample and those left out in front of it do to what is seen through them.
struct Passage {
    tau: f32,
    alpha: f32,
    passing_root: f32,
    // What of the light passes those in front, and what does not.
    gap_passing: f32,
    gap_alpha: f32,
    // What the sample's colour counts beyond alpha, and what is taken from the colour behind beyond alpha of it, seen
    // from the far end of the kept sample in front. Both are 0 where nothing was left out.
    excess: f32,
    taken: f32,
}

fn passage(tau: f32, gap: f32, gain: f32) -> Passage {
    let root = exp_accurate(-0.5 * tau);
    let gap_alpha = opacity(gap);
    let part = Passage(tau, opacity(tau), root, exp_accurate(-gap), gap_alpha, 0.0, root * root * gap_alpha);
    return with_gain(part, gain);
}

fn with_gain(part: Passage, gain: f32) -> Passage {
    var other = part;
    other.excess = part.alpha * ((gain - 1.0) * part.gap_passing - part.gap_alpha);
    return other;
}

// What is seen from in front of a sample, from its colour and what is seen from just behind it.
fn behind_next(behind: Sum, color: vec4<f32>, part: Passage, zero: u32) -> Sum {
    let own = own_color(part.passing_root, color, zero);
    let left_out = part.excess * color - part.taken * behind.value;
    // e^-tau rounds, and would wear out the B of many thin samples.
    let difference = sum_below(own, behind);
    if part.tau < 0.35 {
        return sum_add(sum_add(behind, part.alpha * difference, zero), left_out, zero);
    }
    return sum_add(sum_add(sum_of(own), -squared_times(part.passing_root, difference, zero), zero), left_out, zero);
}

// The part of the opacity behind a sample that no kept sample stands for.
fn missing_next(missing: f32, part: Passage) -> f32 {
    let passing = part.passing_root * part.passing_root - part.taken;
    return part.taken - part.excess + passing * missing;
}
