// Provides: the sparsity's share of the loss, SPARSITY / M times the sum of (1 - T) d ln(1 + sigma / sigma_0): what is
// hidden by what lies in front of it need not be there. 1 - T is a constant as far as gradients go. A kept sample
// stands for as many as it has gain. See `reference::loss`.
// needs: counters, exp, kept_load, log

// What of it a sample has, but for the function of its density.
fn sparsity_part(i: u32, root: f32, gain: f32) -> f32 {
    // The root is that of T.
    return SPARSITY * gain * (1.0 - root * root) * kept_step(i).y;
}

fn sparsity_density(i: u32) -> f32 {
    return exp_accurate(kept_step(i).x) / SPARSE_DENSITY;
}

// As a part of a ray's squared errors, of which the loss is a quarter.
fn sparsity_error(i: u32, root: f32, gain: f32) -> f32 {
    return 4.0 * sparsity_part(i, root, gain) * log_one_plus(sparsity_density(i));
}

fn sparsity_gradient(i: u32, root: f32, gain: f32) -> f32 {
    let x = sparsity_density(i);
    return sparsity_part(i, root, gain) / f32(counters.rays_used) * (x / (1.0 + x));
}
