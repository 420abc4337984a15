// Needs: counters, exp, log. Provides: the sparsity's share of the loss, SPARSITY / M times the sum of
// v T^(1/8) d ln(1 + sigma / sigma_0): what fills places that few cameras see must be worth it. v, the rarity of the
// place, and T^(1/8) are constants as far as gradients go. A kept sample stands for as many as it has gain. See
// `reference::loss`.

// What of it a sample has, but for the function of its density.
fn sparsity_part(i: u32, root: f32, gain: f32) -> f32 {
    let kept = kept_steps_load(i);
    // The root is that of T.
    return SPARSITY * gain * kept.w * sqrt(sqrt(root)) * kept.y;
}

fn sparsity_density(i: u32) -> f32 {
    return exp_accurate(kept_steps_load(i).x) / SPARSE_DENSITY;
}

// As a part of a ray's squared errors, of which the loss is a quarter.
fn sparsity_error(i: u32, root: f32, gain: f32) -> f32 {
    return 4.0 * sparsity_part(i, root, gain) * log_one_plus(sparsity_density(i));
}

fn sparsity_gradient(i: u32, root: f32, gain: f32) -> f32 {
    let x = sparsity_density(i);
    return sparsity_part(i, root, gain) / f32(counters.rays_used) * (x / (1.0 + x));
}
