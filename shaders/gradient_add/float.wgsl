// Provides: gradients of the table by atomic addition of floats.

var<storage, read_write> d_table: array<atomic<f32>>;

fn gradient_add(entry: u32, feature: u32, gradient: f32) {
    if gradient != 0.0 {
        atomicAdd(&d_table[2u * entry + feature], gradient);
    }
}
