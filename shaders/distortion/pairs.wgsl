// Provides: the distortion's share of the loss (Barron et al. 2022, eq. 15), DISTORTION / M times sum_ij w_i w_j |x_i -
// x_j| + 1/3 sum_i w_i^2 dx_i: it pulls the weights of a ray together. x = t / (1 + t), with t in sides of the inner
// cube. Its slope by w_i is the colour of a further channel over 0. See `reference::loss`.
// needs: counters, kept_load, sum, transmittance

struct SpreadRay {
    // Sums of w and of w x: on the way there of the samples so far, on the way back of those behind.
    sums: vec2<f32>,
    error: f32,
    // What lies behind, on the way back.
    behind: Sum,
}

fn spread_begin() -> SpreadRay {
    return SpreadRay(vec2(0.0), 0.0, sum_of(vec4(0.0)));
}

// x of a sample, and how long its step is there.
fn spread_place(i: u32) -> vec2<f32> {
    let kept = kept_step(i);
    let scale = 1.0 / (1.0 + kept.w);
    return vec2(kept.w * scale, kept.y * scale * scale);
}

fn spread_before(spread: SpreadRay) -> vec2<f32> {
    return spread.sums;
}

fn spread_forward(spread: SpreadRay, i: u32, weight: f32) -> SpreadRay {
    let place = spread_place(i);
    var next = spread;
    next.error += weight * (2.0 * (place.x * spread.sums.x - spread.sums.y) + weight * place.y / 3.0);
    next.sums += weight * vec2(1.0, place.x);
    return next;
}

// As a part of a ray's squared errors, of which the loss is a quarter.
fn spread_error(spread: SpreadRay) -> f32 {
    return 4.0 * DISTORTION * spread.error;
}

fn spread_turn(spread: SpreadRay) -> SpreadRay {
    var next = spread;
    next.sums = vec2(0.0);
    return next;
}

// The slope by the weight of a sample, from the sums before it.
fn spread_slope(spread: SpreadRay, i: u32, before: vec2<f32>, weight: f32) -> vec4<f32> {
    let place = spread_place(i);
    let front = place.x * before.x - before.y;
    let back = spread.sums.y - place.x * spread.sums.x;
    let slope = 2.0 * (front + back) + 2.0 * weight * place.y / 3.0;
    return vec4(slope * DISTORTION / f32(counters.rays_used), 0.0, 0.0, 0.0);
}

// The channel's part of dL/ds_i, but for tau and T.
fn spread_gradient(spread: SpreadRay, i: u32, before: vec2<f32>, weight: f32, alpha: f32, missing: f32) -> f32 {
    let slope = spread_slope(spread, i, before, weight);
    return gradient_color(alpha, slope, spread.behind).x - missing * slope.x;
}

fn spread_backward(spread: SpreadRay, i: u32, before: vec2<f32>, weight: f32, part: Passage, zero: u32) -> SpreadRay {
    var next = spread;
    next.behind = behind_next(spread.behind, spread_slope(spread, i, before, weight), part, zero);
    next.sums += weight * vec2(1.0, spread_place(i).x);
    return next;
}
