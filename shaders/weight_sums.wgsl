// The gradients of the networks' weights: L2, and the partial sums of all chunks in a fixed order.
// needs: magnitude

var<storage, read> mlp: array<vec4<f32>>;
tensor<read> d_weight_chunks: vec4<f32>;
var<storage, read_write> d_weights: array<vec4<f32>>;
var<storage, read_write> gradient_range: array<atomic<u32>>;

@compute @workgroup_size(8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= MLP_QUADS {
        return;
    }
    var gradient = L2 * mlp[index];
    for (var chunk = 0u; chunk < CHUNKS; chunk++) {
        gradient += d_weight_chunks_load(chunk * MLP_QUADS + index);
    }
    d_weights[index] = gradient;
    atomicMax(&gradient_range[1], magnitude_bits(gradient));
}
