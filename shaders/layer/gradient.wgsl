// Provides: layer_gradient, four gradients of a row's outputs.

var<storage, read> d_output: array<vec4<f32>>;

fn layer_gradient(row: u32, quad: u32) -> vec4<f32> {
    return d_output[row * OUTPUT_QUADS + quad];
}
