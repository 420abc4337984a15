// Adam on the networks' weights; see `weight_sums.wgsl`.
// needs: adam, usable

var<storage, read> d_weights: array<vec4<f32>>;
var<storage, read_write> mlp: array<vec4<f32>>;
var<storage, read_write> mlp_first: array<vec4<f32>>;
var<storage, read_write> mlp_second: array<vec4<f32>>;

@compute @workgroup_size(8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= MLP_QUADS || !gradients_usable() {
        return;
    }
    let updated = adam_update(Adam(mlp[index], mlp_first[index], mlp_second[index]), d_weights[index]);
    mlp[index] = updated.parameter;
    mlp_first[index] = updated.first;
    mlp_second[index] = updated.second;
}
