// Provides: layer_d_store as in d_hidden, where the inputs lie in the order of all marched samples.

tensor<read> layer_input: vec4<f32>;
tensor<read> kept_rows: vec2<u32>;
tensor<write> d_input: vec4<f32>;

fn layer_d_store(row: u32, quad: u32, sum: vec4<f32>) {
    let positive = layer_input_load(kept_rows_load(row).x * INPUT_QUADS + quad) > vec4(0.0);
    d_input_store(row * INPUT_QUADS + quad, select(vec4(0.0), sum, positive));
}
