// Provides: layer_d_store as in d_hidden, where the inputs lie in the order of all marched samples.

var<storage, read> layer_input: array<vec4<f32>>;
var<storage, read> kept_sample: array<u32>;
var<storage, read_write> d_input: array<vec4<f32>>;

fn layer_d_store(row: u32, quad: u32, sum: vec4<f32>) {
    let positive = layer_input[kept_sample[row] * INPUT_QUADS + quad] > vec4(0.0);
    d_input[row * INPUT_QUADS + quad] = select(vec4(0.0), sum, positive);
}
