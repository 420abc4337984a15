// Provides: layer_store, four outputs of a row.

tensor<write> layer_output: vec4<f32>;

fn layer_store(row: u32, quad: u32, sum: vec4<f32>) {
    layer_output_store(row * OUTPUT_QUADS + quad, sum);
}
