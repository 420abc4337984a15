// Reads of 8 bytes from anywhere in a table, as the hash grid's encoding does. Needs: random.

var<storage, read> table: array<vec2<f32>>;
var<storage, read_write> sink: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    var sum = vec2(0.0);
    for (var round = 0u; round < ROUNDS; round++) {
        sum += table[random_index(id.x, round)];
    }
    sink[id.x & SINK_MASK] = vec4(sum, 0.0, 0.0);
}
