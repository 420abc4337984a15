// A copy of vectors of 16 bytes, in order.

var<storage, read> source: array<vec4<f32>>;
var<storage, read_write> copied: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x + id.y * GROUP_COLUMNS * 64u;
    if index < COUNT {
        copied[index] = source[index];
    }
}
