// Provides: what is counted on the device during a step, and the sizes of its dispatches.
// needs: counted

struct Counters {
    // Rays generated for this step; the last kernel of the step writes the next number.
    rays: u32,
    // Leading rays whose samples fit the budget: the M of the loss.
    rays_used: u32,
    // Marched samples of those rays, and the number all rays asked for.
    samples: u32,
    samples_wanted: u32,
    // Samples kept for colour and backward, and the number all used rays asked for.
    kept: u32,
    kept_wanted: u32,
    // By how much steps are longer than those of the configuration, as a share of them; the last kernel of the step
    // writes the next one.
    step_excess: f32,
    // Sums since the host last cleared them.
    sum_steps: u32,
    sum_rays: u32,
    sum_samples: u32,
    sum_kept: u32,
    // Steps whose gradients could not be used, and which changed nothing.
    sum_skipped: u32,
    // Of the loss (mean over rays and channels) and of the colour's squared error (mean over 3 channels) of the
    // other steps.
    sum_loss: f32,
    sum_color_error: f32,
}
