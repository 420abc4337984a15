//! Everything that decides how kernels are linked, and how large their buffers are.

use super::capacity::Rounds;
use super::layout::Layout;
use super::{Capabilities, Capacity, SceneFeatures, Space, layer::Product};
use crate::camera::LensKind;
use crate::config::{Accumulation, ColorLoss, Config};
use crate::gpu::Gpu;
use crate::gpu::tensor::TensorMemory;
use std::collections::BTreeSet;
use std::sync::Arc;

/// llvmpipe ends the loops of a thread after so many rounds together, without an error; ordered sums have one round
/// per kept sample.
const LONGEST_LOOP: usize = 65_535;

/// Everything that decides how kernels are linked.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The resolved configuration, which a run and its checkpoints share.
    pub config: Arc<Config>,
    /// The parameters' layout.
    pub layout: Layout,
    /// The scene's features, which kernels are linked for.
    pub features: SceneFeatures,
    /// Where the scene is.
    pub space: Space,
    /// What there is room for.
    pub capacity: Capacity,
    /// How matrix products are written.
    pub product: Product,
    /// How the table's gradients are summed.
    pub accumulation: Accumulation,
    /// Where tensors live.
    pub memory: TensorMemory,
    /// Chunks of samples whose weight gradients are summed apart: what runs side by side.
    pub chunks: usize,
    /// Threads that march a ray of a step together. A thread that marches a ray of a view knows how many samples it has.
    pub march_lanes: usize,
    /// How much of a view is in work at once.
    pub rounds: Rounds,
}

impl Plan {
    /// Chooses what depends on the adapter; `grid.finest` is never 0.
    #[must_use]
    pub fn new(gpu: &Gpu, config: impl Into<Arc<Config>>, features: SceneFeatures, space: Space) -> Self {
        Self::suited_to(Capabilities::of(gpu), config, features, space)
    }

    /// As [`Plan::new`], for an adapter that need not be there.
    #[must_use]
    pub fn suited_to(
        adapter: Capabilities,
        config: impl Into<Arc<Config>>,
        features: SceneFeatures,
        space: Space,
    ) -> Self {
        let config = config.into();
        let layout = Layout::new(&config);
        let capacity = Capacity::of_steps(&config.batch);
        let orders = adapter.is_cpu && capacity.kept <= LONGEST_LOOP;
        let integers = if adapter.long_atomics { Accumulation::Long } else { Accumulation::Fixed };
        let accumulation = match config.accumulation {
            Accumulation::Ordered if adapter.is_cpu && !orders => integers,
            Accumulation::Auto if orders => Accumulation::Ordered,
            Accumulation::Auto if config.deterministic => integers,
            Accumulation::Auto if adapter.float_atomics => Accumulation::Float,
            Accumulation::Auto => Accumulation::Exchange,
            chosen => chosen,
        };
        // A GPU has more threads than a step has rays.
        let march_lanes = if adapter.is_cpu { 1 } else { 4 };
        let product = match adapter {
            Capabilities { is_cpu: false, .. } => Product::Tiled,
            Capabilities { subgroups_of_8: true, .. } => Product::SharedWeights,
            _ => Product::Rows(4),
        };
        let chunks = if adapter.is_cpu { 32 } else { 512 };
        let rounds = Rounds::suited_to(adapter);
        let memory = adapter.memory;
        Self {
            config,
            layout,
            features,
            space,
            capacity,
            product,
            accumulation,
            memory,
            chunks,
            march_lanes,
            rounds,
        }
    }

    /// The plan of a renderer of the same field for cameras with `lenses`, whose room does not depend on the run's.
    #[must_use]
    pub fn for_views(&self, lenses: &BTreeSet<LensKind>) -> Self {
        let features = SceneFeatures { lenses: lenses.clone(), ..self.features.clone() };
        Self { features, capacity: Capacity::of_rounds(&self.rounds), ..self.clone() }
    }

    /// The least and the largest step of a ray, in box units.
    #[must_use]
    pub fn step_range(&self) -> [f64; 2] {
        self.space.step_range(&self.config.march, self.config.occupancy.cells)
    }

    /// The least step in sides of the inner cube: the length that an optical depth of the occupancy grid is taken over.
    #[must_use]
    pub fn least_step(&self) -> f64 {
        self.step_range()[0] * self.space.cubes_per_box()
    }

    /// Cells of the occupancy grid over all cascades.
    #[must_use]
    pub fn cell_count(&self) -> usize {
        self.space.grid_shape(self.config.occupancy.cells).iter().product()
    }

    /// Marched samples that a step aims at, so that they usually fit.
    #[must_use]
    pub fn target_samples(&self) -> usize {
        self.capacity.samples / 8 * 7
    }

    /// Words that hold one bit per step of a ray.
    #[must_use]
    pub fn step_words(&self) -> usize {
        self.config.march.most_steps.div_ceil(32)
    }

    /// Whether the loss has use for distances along rays.
    #[must_use]
    pub fn needs_distances(&self) -> bool {
        self.features.depth || self.config.loss.distortion > 0.0
    }

    /// Whether colour errors count relative to the colour.
    #[must_use]
    pub fn has_relative_loss(&self) -> bool {
        match self.config.loss.color {
            ColorLoss::Auto => self.features.hdr,
            chosen => chosen == ColorLoss::Relative,
        }
    }
}
