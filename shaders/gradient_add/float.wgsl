// Provides: gradients of the table by atomic addition of floats.

var<storage, read_write> d_table: array<atomic<f32>>;

fn gradient_add(entry: u32, gradient: vec2<f32>) {
    if gradient.x != 0.0 {
        atomicAdd(&d_table[2u * entry], gradient.x);
    }
    if gradient.y != 0.0 {
        atomicAdd(&d_table[2u * entry + 1u], gradient.y);
    }
}
