// Provides: layer_d_store, the gradient in front of the ReLU that made this layer's inputs.

tensor<read> layer_input: vec4<f32>;
tensor<write> d_input: vec4<f32>;

fn layer_d_store(row: u32, quad: u32, sum: vec4<f32>) {
    let positive = layer_input_load(row * INPUT_QUADS + quad) > vec4(0.0);
    d_input_store(row * INPUT_QUADS + quad, select(vec4(0.0), sum, positive));
}
