// Provides: pack, what a view keeps of a chosen sample: nothing more.

fn pack(row: u32, ray: u32, choice: vec4<f32>) {
}
