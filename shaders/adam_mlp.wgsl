// Adam on the networks' weights, with L2: sums the partial gradients of all chunks first, in a fixed order.
// Needs: step, adam.

tensor<read> d_weight_chunks: vec4<f32>;
var<storage, read_write> mlp: array<vec4<f32>>;
var<storage, read_write> mlp_first: array<vec4<f32>>;
var<storage, read_write> mlp_second: array<vec4<f32>>;

@compute @workgroup_size(8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= MLP_QUADS {
        return;
    }
    let weight = mlp[index];
    var gradient = L2 * weight;
    for (var chunk = 0u; chunk < CHUNKS; chunk++) {
        gradient += d_weight_chunks_load(chunk * MLP_QUADS + index);
    }
    let updated = adam_update(Adam(weight, mlp_first[index], mlp_second[index]), gradient);
    mlp[index] = updated.parameter;
    mlp_first[index] = updated.first;
    mlp_second[index] = updated.second;
}
