// Provides: layer_load, four inputs of a row.

var<storage, read> layer_input: array<vec4<f32>>;

fn layer_load(row: u32, quad: u32) -> vec4<f32> {
    return layer_input[row * INPUT_QUADS + quad];
}
