// The marched samples: which rays fit, and the sizes of the dispatches over samples.
// needs: counters, dispatch

fn scan_rays() -> u32 {
    return counters.rays;
}

fn scan_finish(rays_used: u32, samples: u32, wanted: u32) {
    counters.rays_used = rays_used;
    counters.samples = samples;
    counters.samples_wanted = wanted;
    dispatch_over_samples(samples);
}
