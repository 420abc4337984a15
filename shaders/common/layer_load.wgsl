// Provides: layer_load, four inputs of a row.

tensor<read> layer_input: vec4<f32>;

fn layer_load(row: u32, quad: u32) -> vec4<f32> {
    return layer_input_load(row * INPUT_QUADS + quad);
}
