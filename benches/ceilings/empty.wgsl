// Nothing but a write that the next one has to wait for.

var<storage, read_write> sink: array<vec4<f32>>;

@compute @workgroup_size(1)
fn main() {
    sink[0] = vec4(1.0);
}
