//! Indices of the dispatch sizes that kernels write.

/// Over rays.
pub const RAYS: usize = 0;
/// Over marched samples.
pub const SAMPLES: usize = 1;
/// Over marched samples and pairs of levels.
pub const ENCODE: usize = 2;
/// Over marched samples, several per thread.
pub const SAMPLE_TILES: usize = 3;
/// Over kept samples.
pub const KEPT: usize = 4;
/// Over kept samples, several per thread.
pub const KEPT_TILES: usize = 5;
/// Over levels and runs of kept samples, four threads each.
pub const SCATTER: usize = 6;
/// How many there are.
pub const COUNT: usize = 7;
