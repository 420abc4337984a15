// Provides: gradient_take for gradients summed as floats by atomics.

var<storage, read_write> d_table: array<vec2<f32>>;

// Reads and clears.
fn gradient_take(entry: u32) -> vec2<f32> {
    let gradient = d_table[entry];
    if gradient.x != 0.0 || gradient.y != 0.0 {
        d_table[entry] = vec2(0.0);
    }
    return gradient;
}
