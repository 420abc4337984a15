// Provides: layer_gradient, the gradient of the colour network's raw outputs, which it also stores for the
// weights' gradient. Needs: activation.

var<storage, read> color: array<vec4<f32>>;
var<storage, read> d_color: array<vec4<f32>>;
var<storage, read_write> d_raw_color: array<vec4<f32>>;

fn layer_gradient(row: u32, quad: u32) -> vec4<f32> {
    let gradient = vec4(color_activation_backward(color[row].rgb, d_color[row].rgb), 0.0);
    d_raw_color[row] = gradient;
    return gradient;
}
