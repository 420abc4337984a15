//! Indices of the dispatch sizes that kernels write.

/// Over rays.
pub const RAYS: usize = 0;
/// Over marched samples and pairs of levels.
pub const ENCODE: usize = 1;
/// Over marched samples, several per thread.
pub const SAMPLE_TILES: usize = 2;
/// Over kept samples.
pub const KEPT: usize = 3;
/// Over kept samples, several per thread.
pub const KEPT_TILES: usize = 4;
/// Over levels and runs of kept samples, four threads each.
pub const SCATTER: usize = 5;
/// How many there are.
pub const COUNT: usize = 6;
