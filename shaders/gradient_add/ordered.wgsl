// Provides: gradients of the table by plain sums, for one thread per level.

tensor<read_write> d_table: vec2<f32>;

fn gradient_add(entry: u32, gradient: vec2<f32>) {
    d_table_store(entry, d_table_load(entry) + gradient);
}
