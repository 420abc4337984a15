// Provides: gradient_take for gradients summed as integers; see gradient/fixed.wgsl.
// needs: fixed_scale

// Low and high half of both sums.
var<storage, read_write> d_table: array<vec4<u32>>;

fn float_of(sum: vec2<u32>) -> f32 {
    var size = sum;
    let is_negative = sum.y >= 0x80000000u;
    if is_negative {
        size = vec2(~sum.x + 1u, ~sum.y + select(0u, 1u, sum.x == 0u));
    }
    let value = (f32(size.y) * power_of_two(32) + f32(size.x)) * power_of_two(-gradient_scale_exponent());
    return select(value, -value, is_negative);
}

// Reads and clears.
fn gradient_take(entry: u32) -> vec2<f32> {
    let sums = d_table[entry];
    if all(sums == vec4(0u)) {
        return vec2(0.0);
    }
    d_table[entry] = vec4(0u);
    return vec2(float_of(sums.xy), float_of(sums.zw));
}
