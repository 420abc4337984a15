// Multiply-adds of f32, in chains that do not wait for each other: 8 of 4 per round.

var<storage, read_write> sink: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let factor = vec4(0.9999, 0.9998, 0.9997, 0.9996);
    let term = vec4(f32(id.x & 255u)) * 1e-4;
    var a = term;
    var b = term + 0.1;
    var c = term + 0.2;
    var d = term + 0.3;
    var e = term + 0.4;
    var f = term + 0.5;
    var g = term + 0.6;
    var h = term + 0.7;
    for (var round = 0u; round < ROUNDS; round++) {
        a = a * factor + term;
        b = b * factor + term;
        c = c * factor + term;
        d = d * factor + term;
        e = e * factor + term;
        f = f * factor + term;
        g = g * factor + term;
        h = h * factor + term;
    }
    sink[id.x & SINK_MASK] = (a + b) + (c + d) + ((e + f) + (g + h));
}
