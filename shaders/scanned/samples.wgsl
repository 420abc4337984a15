// The marched samples: which rays fit, and the sizes of the dispatches over samples.
// needs: counters

fn scan_rays() -> u32 {
    return counters.rays;
}

fn scan_finish(rays_used: u32, samples: u32, wanted: u32) {
    counters.rays_used = rays_used;
    counters.samples = samples;
    counters.samples_wanted = wanted;
    dispatch[DISPATCH_ENCODE] = vec3(workgroups(samples, 64u).x, LEVELS / 2u, 1u);
    dispatch[DISPATCH_SAMPLE_TILES] = workgroups(samples, 64u * SAMPLES_PER_THREAD);
}
