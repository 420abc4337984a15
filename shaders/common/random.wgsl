// Provides: random_u32, random_f32. The same integers as `reference::random`.

fn pcg(value: u32) -> u32 {
    let state = value * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// `stream` is pcg(step + pcg(seed)), computed once per step on the host.
fn random_u32(stream: u32, index: u32, dimension: u32) -> u32 {
    return pcg(dimension + pcg(index + stream));
}

// Uniform in [0, 1).
fn random_f32(stream: u32, index: u32, dimension: u32) -> f32 {
    return f32(random_u32(stream, index, dimension) >> 8u) * 5.9604645e-8;
}
