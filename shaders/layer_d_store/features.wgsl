// Provides: layer_d_store, the gradient of the density network's outputs; the first one also carries the gradient of
// the log-density that the fused kernel found.
// needs: density

tensor<read> d_color: vec4<f32>;
tensor<read> density_out: vec4<f32>;
tensor<read> kept_rows: vec2<u32>;
tensor<write> d_input: vec4<f32>;

fn layer_d_store(row: u32, quad: u32, sum: vec4<f32>) {
    var gradient = sum;
    if quad == 0u {
        let raw = density_out_load(kept_rows_load(row).x * DENSITY_QUADS).x;
        gradient.x += density_log_backward(raw, d_color_load(row).w);
    }
    d_input_store(row * (DENSITY_QUADS) + quad, gradient);
}
