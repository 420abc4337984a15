// Provides: layer_d_store, the gradient of the density network's outputs; the first one also carries the
// gradient of the log-density that the fused kernel found. Needs: density.

var<storage, read> d_color: array<vec4<f32>>;
var<storage, read> density_out: array<f32>;
var<storage, read> kept_sample: array<u32>;
var<storage, read> kept_gain: array<f32>;
var<storage, read_write> d_input: array<vec4<f32>>;

fn layer_d_store(row: u32, quad: u32, sum: vec4<f32>) {
    var gradient = sum;
    if quad == 0u {
        let raw = density_out[kept_sample[row] * DENSITY_OUTPUTS];
        gradient.x += density_log_backward(raw, d_color[row].w * kept_gain[row]);
    }
    d_input[row * (DENSITY_OUTPUTS / 4u) + quad] = gradient;
}
