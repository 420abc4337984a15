//! The numbers that kernels know at compile time.

use super::{Plan, dispatch};
use crate::config::Transmittance;
use crate::field::layout::DENSITY_OUTPUTS;
use crate::gpu::pass::GROUP_COLUMNS;
use crate::gpu::source::Source;
use std::fmt::Display;

/// Dimensions of the random numbers, as the kernels draw them.
pub mod dimension {
    /// The view of a training ray.
    pub const IMAGE: u32 = 0;
    /// Its pixel.
    pub const PIXEL: u32 = 1;
    /// Where its first sample lies.
    pub const OFFSET: u32 = 2;
    /// Red, green and blue of its background, in this dimension and the next two.
    pub const BACKGROUND: u32 = 4;
    /// Position in a cell of the occupancy grid, in this dimension and the next two.
    pub const CELL: u32 = 8;
    /// Which of a group of light samples stands for it in one estimate of the colour; in the next dimension, in the other.
    pub const SELECTION: u32 = 11;
    /// Whether the lightest groups are kept, likewise.
    pub const LIGHT: u32 = 13;
}

/// Added to the squared colour that an error is relative to, as in tiny-cuda-nn's RelativeL2.
pub const RELATIVE_FLOOR: f64 = 0.01;
/// Part of the photo's brightness that a rendered colour is at least taken for in relative errors.
const RELATIVE_DARKEST: f64 = 1e-3;

/// Density above which more of it costs the sparsity little, per side of the inner cube.
const SPARSE_DENSITY: f64 = 5.0;

/// Kept samples, one behind the other, whose gradients are summed before they are added to the table where they share a
/// cell. A ray has about as many.
const SCATTER_RUN: usize = 8;

/// Least change of the length of all steps along rays from one training step to the next.
pub const STEP_SHRINKAGE: f64 = 0.99;
/// The most.
pub const STEP_GROWTH: f64 = 1.02;

impl Plan {
    /// `source` with everything that kernels know at compile time.
    pub(super) fn constants(&self, source: Source) -> Source {
        self.numbers(self.dimensions(source))
    }

    fn dimensions(&self, source: Source) -> Source {
        let Self { config, layout, space, .. } = self;
        let counts = [
            ("RECORD_WORDS", self.record().words()),
            ("POSITION_WORD", self.record().position()),
            ("DEPTH_WORD", self.record().depth()),
            ("LEVELS", layout.levels.len()),
            ("TABLE_ENTRIES", layout.entries),
            ("DENSITY_OUTPUTS", DENSITY_OUTPUTS),
            ("DENSITY_QUADS", DENSITY_OUTPUTS / 4),
            ("MLP_QUADS", layout.quads),
            ("CHUNKS", self.chunks),
            ("GROUP_COLUMNS", GROUP_COLUMNS as usize),
            ("SAMPLES_PER_THREAD", self.product.rows()),
            ("CELLS", config.occupancy.cells as usize),
            ("CELL_COUNT", self.cell_count()),
            ("CASCADES", space.cascades()),
            ("MAX_STEPS", config.march.most_steps),
            ("STEP_WORDS", self.step_words()),
            ("TARGET_KEPT", config.batch.kept),
            ("TARGET_SAMPLES", self.target_samples()),
            ("LEAST_RAYS", 16),
            ("MOST_RAYS", config.batch.rays),
            ("ROUND_SAMPLES", self.rounds.samples),
            ("MOST_QUOTA", self.rounds.most_quota),
            ("NO_PIXEL", u32::MAX as usize),
            ("DISPATCH_RAYS", dispatch::RAYS),
            ("DISPATCH_SAMPLES", dispatch::SAMPLES),
            ("DISPATCH_ENCODE", dispatch::ENCODE),
            ("DISPATCH_SAMPLE_TILES", dispatch::SAMPLE_TILES),
            ("DISPATCH_KEPT", dispatch::KEPT),
            ("DISPATCH_KEPT_TILES", dispatch::KEPT_TILES),
            ("DISPATCH_SCATTER", dispatch::SCATTER),
            ("SCATTER_RUN", SCATTER_RUN),
            ("RANDOM_IMAGE", dimension::IMAGE as usize),
            ("RANDOM_PIXEL", dimension::PIXEL as usize),
            ("RANDOM_OFFSET", dimension::OFFSET as usize),
            ("RANDOM_SELECTION", dimension::SELECTION as usize),
            ("RANDOM_LIGHT", dimension::LIGHT as usize),
            ("RANDOM_BACKGROUND", dimension::BACKGROUND as usize),
            ("RANDOM_CELL", dimension::CELL as usize),
        ];
        counts.iter().fold(source, |source, (name, value)| source.count(name, *value))
    }

    fn numbers(&self, source: Source) -> Source {
        let Self { config, space, .. } = self;
        let [least, most] = self.step_range();
        let floats = [
            ("STEP_MIN", least),
            ("STEP_MAX", most),
            ("CONE", config.march.cone),
            ("SAMPLES_PER_RAY", config.march.samples_per_ray),
            ("LONGEST_STEP", config.march.longest_step),
            ("STEP_SHRINKAGE", STEP_SHRINKAGE),
            ("STEP_GROWTH", STEP_GROWTH),
            ("DENSITY_SCALE", space.cubes_per_box()),
            ("T_NEAR", space.near(&config.march)),
            ("WEIGHT_FLOOR", self.weight_floor()),
            ("LIGHT_SHARE", config.selection.light_share.max(1e-6)),
            ("STOP_TRANSMITTANCE", config.selection.stop_transmittance),
            ("COLOR_WEIGHT", self.rounds.color_weight(&self.features)),
            ("OCCUPANCY_DECAY", config.occupancy.decay),
            ("OCCUPANCY_THRESHOLD", config.occupancy.threshold),
            ("BETA_1", config.optimizer.beta_1),
            ("BETA_2", config.optimizer.beta_2),
            ("EPSILON", config.optimizer.epsilon),
            ("RELATIVE_FLOOR", RELATIVE_FLOOR),
            ("RELATIVE_DARKEST", RELATIVE_DARKEST),
            ("DEPTH_WEIGHT", config.loss.depth),
            ("DISTORTION", config.loss.distortion),
            ("SPARSITY", config.loss.sparsity),
            ("SPARSE_DENSITY", SPARSE_DENSITY),
        ];
        let source = floats.iter().fold(source, |source, (name, value)| source.float(name, *value));
        let background = config.background.solid().map(|value| value / self.features.grey);
        source.constant("BACKGROUND", vec3(background))
    }

    /// Inclusive weights are no shares of one whole, so that none can stand for others.
    fn weight_floor(&self) -> f64 {
        match self.config.transmittance {
            Transmittance::Inclusive => 0.0,
            Transmittance::Exclusive => self.config.selection.weight_floor,
        }
    }
}

fn vec3(value: [f32; 3]) -> impl Display {
    let [x, y, z] = value;
    format!("vec3<f32>({x:?}, {y:?}, {z:?})")
}
