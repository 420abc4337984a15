// Provides: layer_store, the colour of a row.
// needs: activation

tensor<write> color: vec4<f32>;

fn layer_store(row: u32, quad: u32, sum: vec4<f32>) {
    color_store(row, vec4(color_activation(sum.rgb), 0.0));
}
