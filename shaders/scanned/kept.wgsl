// The kept samples: which rays fit, and the sizes of the dispatches over kept samples.
// needs: counters, dispatch

fn scan_rays() -> u32 {
    return counters.rays_used;
}

fn scan_finish(rays_used: u32, kept: u32, wanted: u32) {
    counters.rays_used = rays_used;
    counters.kept = kept;
    counters.kept_wanted = wanted;
    dispatch_over_kept(kept);
}
