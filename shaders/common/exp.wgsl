// Provides: exponentials whose error does not depend on the driver (WGSL allows exp 3 + 2|x| ulp and has no
// expm1), optical depth and opacity; section 2 of the design.

// e^x = fraction * 2^exponent.
struct Exponential {
    fraction: f32,
    exponent: i32,
}

// For |x| <= 256; relative error about 1e-7, fraction within [0.7, 1.42].
fn exponential(x: f32) -> Exponential {
    let n = i32(round(x * 1.44269504));
    // ln 2 in two parts, the first 355/512, so that n times it is exact and the difference does not round. The
    // product is one of integers: compilers may put the two parts together again if both are floats.
    let r = (x - f32(n * 355) / 512.0) + f32(n) * 2.12194440e-4;
    let series = 1.0 + r * (1.0 + r * (0.5 + r * (0.166666667 + r * (0.0416666667 + r * (8.33333333e-3
        + r * (1.38888889e-3 + r * 1.98412698e-4))))));
    return Exponential(series, n);
}

// fraction * 2^exponent, the exponent within [-126, 127].
fn scaled(fraction: f32, exponent: i32) -> f32 {
    return fraction * bitcast<f32>(u32(exponent + 127) << 23u);
}

// e^x for x in [-87, 88], 0 below.
fn exp_accurate(x: f32) -> f32 {
    let e = exponential(clamp(x, -88.0, 88.0));
    return select(scaled(e.fraction, e.exponent), 0.0, x < -87.0);
}

// Where nothing passes any more: e^-200 is 0 even as the square of a float.
const OPTICAL_DEPTH_MOST = 200.0;

// tau = exp(s) * delta; 0 for a step of length 0. Fractions and exponents are multiplied apart: either factor may
// be far beyond a float where tau is not, and s + ln(delta) would round to half a unit of a large sum. Beyond
// OPTICAL_DEPTH_MOST tau would only multiply rounding noise by a huge number.
fn optical_depth(log_density: f32, delta: f32) -> f32 {
    var bits = bitcast<i32>(delta);
    // Negative, zero, or not a number.
    if bits <= 0 || bits > 0x7f800000 {
        return 0.0;
    }
    var bias = 127;
    if bits < 0x00800000 {
        // Subnormal: a driver may take it for 0. As an integer it is a multiple of 2^-149.
        bits = bitcast<i32>(f32(bits));
        bias = 127 + 149;
    }
    let fraction = bitcast<f32>((bits & 0x007fffff) | 0x3f800000);
    let e = exponential(clamp(log_density, -200.0, 200.0));
    let exponent = e.exponent + (bits >> 23u) - bias;
    let tau = min(scaled(e.fraction * fraction, clamp(exponent, -126, 9)), OPTICAL_DEPTH_MOST);
    return select(tau, 0.0, exponent < -126);
}

// 1 - e^-tau, by its series where the difference would cancel.
fn opacity(tau: f32) -> f32 {
    if tau < 0.35 {
        return tau * (1.0 - tau / 2.0 * (1.0 - tau / 3.0 * (1.0 - tau / 4.0 * (1.0 - tau / 5.0
            * (1.0 - tau / 6.0 * (1.0 - tau / 7.0))))));
    }
    return 1.0 - exp_accurate(-tau);
}

// root^2 * value. Transmittances come as their roots: behind a wall they leave the range of a float where their
// product with an HDR colour and its error does not. `zero` is 0, but only at run time: NVIDIA's compiler makes
// (root * root) * value of it otherwise.
fn squared_times(root: f32, value: vec4<f32>, zero: u32) -> vec4<f32> {
    return root * bitcast<vec4<f32>>(bitcast<vec4<u32>>(root * value) ^ vec4(zero));
}
