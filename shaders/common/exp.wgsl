// Provides: exponentials whose error does not depend on the driver (WGSL allows exp 3 + 2|x| ulp and has no
// expm1), optical depth and opacity; section 2 of the design.

// e^x for x in [-87, 88], 0 below; relative error about 1e-7.
fn exp_accurate(x: f32) -> f32 {
    let bounded = clamp(x, -88.0, 88.0);
    let n = round(bounded * 1.44269504);
    // ln 2 in two parts, the first exact in few bits, so that the difference does not round.
    let r = (bounded - n * 0.693359375) + n * 2.12194440e-4;
    let series = 1.0 + r * (1.0 + r * (0.5 + r * (0.166666667 + r * (0.0416666667 + r * (8.33333333e-3
        + r * (1.38888889e-3 + r * 1.98412698e-4))))));
    let power = bitcast<f32>(u32(i32(n) + 127) << 23u);
    return select(series * power, 0.0, x < -87.0);
}

// tau = exp(s) * delta; clamped at 100, where nothing passes any more, so that tau * e^-tau does not
// multiply rounding noise by a huge tau. 0 for a step of length 0.
fn optical_depth(log_density: f32, delta: f32) -> f32 {
    if !(delta > 0.0) {
        return 0.0;
    }
    return exp_accurate(min(log_density + log(delta), 4.60517019));
}

// 1 - e^-tau, by its series where the difference would cancel.
fn opacity(tau: f32) -> f32 {
    if tau < 0.35 {
        return tau * (1.0 - tau / 2.0 * (1.0 - tau / 3.0 * (1.0 - tau / 4.0 * (1.0 - tau / 5.0
            * (1.0 - tau / 6.0 * (1.0 - tau / 7.0))))));
    }
    return 1.0 - exp_accurate(-tau);
}

// e^-tau: directly, except where 1 - opacity is the more accurate of the two.
fn passing(tau: f32, alpha: f32) -> f32 {
    if tau < 0.35 {
        return 1.0 - alpha;
    }
    return exp_accurate(-tau);
}
