// Provides: gradient_scale, the power of two by which gradients become 64-bit integers: the largest with which the sum
// of all kept samples' gradients cannot overflow. What it loses is 2^-60 of the largest gradient, times the number of
// samples.
// needs: counters, usable

fn gradient_scale_exponent() -> i32 {
    // |gradient| < 2^most, and the number of samples < 2^samples.
    let most = i32(gradient_range[0] >> 23u) - 126;
    let samples = 32 - i32(countLeadingZeros(counters.kept));
    return min(62 - samples - most, 100);
}

fn power_of_two(exponent: i32) -> f32 {
    return bitcast<f32>(u32(exponent + 127) << 23u);
}
