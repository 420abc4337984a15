// Provides: ln(1 + x) for x from 0 on; up to 1 by the series of the inverse hyperbolic tangent, since WGSL's log is only
// as good as its argument rounds.

fn log_one_plus(x: f32) -> f32 {
    let y = x / (2.0 + x);
    let square = y * y;
    let series = 1.0 + square * (0.333333333 + square * (0.2 + square * (0.142857143 + square * 0.111111111)));
    return select(log(1.0 + x), 2.0 * y * series, x <= 1.0);
}
