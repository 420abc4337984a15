// Provides: how far the rendering of a view's band of pixels is.

struct Progress {
    // Most samples of a ray in this round.
    quota: u32,
    // Rays in work.
    rays: u32,
    // Rounds begun.
    rounds: u32,
    // The first pixel among the rays that begin in this round, and among those of the next.
    first_pixel: u32,
    next_pixel: u32,
    // The band: its first pixel, and the one behind its last.
    band_begin: u32,
    band_end: u32,
}
