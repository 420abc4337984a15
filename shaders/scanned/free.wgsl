// The free slots of a view's rays, which take the next pixels, and what a ray may ask for in the round that begins.
// needs: counters, progress

var<storage, read_write> progress: Progress;

fn scan_rays() -> u32 {
    return counters.rays;
}

fn scan_finish(slots: u32, free: u32, wanted: u32) {
    let first = progress.next_pixel;
    let begun = min(free, progress.band_end - first);
    let rays = slots - free + begun;
    progress.first_pixel = first;
    progress.next_pixel = first + begun;
    progress.rays = rays;
    progress.rounds += min(rays, 1u);
    progress.quota = clamp(ROUND_SAMPLES / max(rays, 1u), 1u, MOST_QUOTA);
}
