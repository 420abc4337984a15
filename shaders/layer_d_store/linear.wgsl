// Provides: layer_d_store, the gradient of inputs that no activation made.

tensor<write> d_input: vec4<f32>;

fn layer_d_store(row: u32, quad: u32, sum: vec4<f32>) {
    d_input_store(row * INPUT_QUADS + quad, sum);
}
