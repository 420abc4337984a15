// Provides: gradient_take for gradients summed in order.

tensor<read_write> d_table: vec2<f32>;

// Reads and clears.
fn gradient_take(entry: u32) -> vec2<f32> {
    let gradient = d_table_load(entry);
    if gradient.x != 0.0 || gradient.y != 0.0 {
        d_table_store(entry, vec2(0.0));
    }
    return gradient;
}
