// The marched samples: which rays fit, and the sizes of the dispatches over samples.
// Needs: counters, scan.

fn scan_rays() -> u32 {
    return counters.rays;
}

fn scan_finish(rays_used: u32, samples: u32, wanted: u32) {
    counters.rays_used = rays_used;
    counters.samples = samples;
    counters.samples_wanted = wanted;
    dispatch[DISPATCH_SAMPLES] = workgroups(samples, 64u);
    dispatch[DISPATCH_SAMPLE_TILES] = workgroups(samples, 64u * SAMPLES_PER_THREAD);
}
