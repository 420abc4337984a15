//! What the sizes of buffers follow from, and the settings to change where they do not fit.

/// The number of rays.
pub(super) const RAYS: &str = "batch (batch.rays)";
/// That of samples and of what the networks make of them: most buffers.
pub(super) const SAMPLES: &str = "batch (batch.samples, and batch.kept with it) or network (network.width)";
/// That of weights.
pub(super) const WEIGHTS: &str = "network (network.width, network.color_layers)";
/// That of entries of the hash table.
pub(super) const ENTRIES: &str = "table (grid.log2_table)";
/// That of cells of the occupancy grid.
pub(super) const CELLS: &str = "occupancy grid (occupancy.cells)";
