// Provides: layer_d_store, the gradient in front of the ReLU that made this layer's inputs.

var<storage, read> layer_input: array<vec4<f32>>;
var<storage, read_write> d_input: array<vec4<f32>>;

fn layer_d_store(row: u32, quad: u32, sum: vec4<f32>) {
    let positive = layer_input[row * INPUT_QUADS + quad] > vec4(0.0);
    d_input[row * INPUT_QUADS + quad] = select(vec4(0.0), sum, positive);
}
