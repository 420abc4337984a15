// Provides: layer_gradient, the gradient of the colour network's raw outputs, which it also stores for the weights'
// gradient.
// needs: activation

tensor<read> color: vec4<f32>;
tensor<read> d_color: vec4<f32>;
tensor<write> d_raw_color: vec4<f32>;

fn layer_gradient(row: u32, quad: u32) -> vec4<f32> {
    let gradient = vec4(color_activation_backward(color_load(row).rgb, d_color_load(row).rgb), 0.0);
    d_raw_color_store(row, gradient);
    return gradient;
}
