// Adam on a group of parameters that all have gradients.
// needs: adam, usable

var<storage, read> gradients: array<vec4<f32>>;
var<storage, read_write> parameters: array<vec4<f32>>;
var<storage, read_write> first_moments: array<vec4<f32>>;
var<storage, read_write> second_moments: array<vec4<f32>>;

@compute @workgroup_size(8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= PARAMETER_QUADS || !gradients_usable() {
        return;
    }
    let old = Adam(parameters[index], first_moments[index], second_moments[index]);
    let updated = adam_update(old, gradients[index]);
    parameters[index] = updated.parameter;
    first_moments[index] = updated.first;
    second_moments[index] = updated.second;
}
