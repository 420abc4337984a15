// Provides: the sparsity's share of the loss where it has none.

fn sparsity_error(i: u32, root: f32, gain: f32) -> f32 {
    return 0.0;
}

fn sparsity_gradient(i: u32, root: f32, gain: f32) -> f32 {
    return 0.0;
}
