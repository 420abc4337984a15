// Provides: gradient_take for fixed-point gradients; see gradient/fixed.wgsl.

// Low and high half of each sum.
var<storage, read_write> d_table: array<vec2<u32>>;

// Reads and clears.
fn gradient_take(entry: u32, rays: f32) -> vec2<f32> {
    let packed = d_table[entry];
    if packed.x == 0u && packed.y == 0u {
        return vec2(0.0);
    }
    d_table[entry] = vec2(0u);
    let low = bitcast<i32>(packed.x);
    // A negative low half borrowed one from the high half.
    let high = bitcast<i32>(packed.y) + select(0, 1, low < 0);
    return vec2(f32(low), f32(high)) / (2.0 * rays * GRADIENT_SCALE);
}
