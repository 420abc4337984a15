// Provides: layer_gradient, four gradients of a row's outputs.

tensor<read> d_output: vec4<f32>;

fn layer_gradient(row: u32, quad: u32) -> vec4<f32> {
    return d_output_load(row * OUTPUT_QUADS + quad);
}
