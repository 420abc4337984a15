// Provides: layer_store, four outputs of a row.

var<storage, read_write> layer_output: array<vec4<f32>>;

fn layer_store(row: u32, quad: u32, sum: vec4<f32>) {
    layer_output[row * OUTPUT_QUADS + quad] = sum;
}
