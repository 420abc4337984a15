// Provides: layer_d_store, the gradient of inputs that no activation made.

var<storage, read_write> d_input: array<vec4<f32>>;

fn layer_d_store(row: u32, quad: u32, sum: vec4<f32>) {
    d_input[row * INPUT_QUADS + quad] = sum;
}
