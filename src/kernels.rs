//! The list of kernels: which parts each one links, which buffers it is given, in which order they run.
//!
//! Parts for what a scene does not need (a lens, cascades, alpha, …) are not linked, their buffers are not
//! allocated and their stages are not dispatched.

/// Includes a file of `shaders/` as a [`Part`].
macro_rules! part {
    ($path:literal) => {
        ($path, include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $path)))
    };
}
pub(crate) use part;

pub mod color;
pub mod density;
pub mod layer;
pub mod lens;
pub mod marching;
mod memory;
mod needs;
pub mod occupancy;
pub mod photos;
mod shared;
pub mod training;
pub mod viewing;
mod workspace;

pub use needs::Needs;
pub use shared::{Camera, Counters, Progress, Step};
pub use workspace::Workspace;

use crate::config::{Accumulation, Background, ColorLoss, Config, Transmittance};
use crate::gpu::Gpu;
use crate::gpu::kernel::{Kernel, Shared};
use crate::gpu::source::Source;
use crate::gpu::tensor::Memory;
use crate::model::{DENSITY_OUTPUTS, Layout, Level};
use anyhow::Result;
use std::fmt::Display;

/// A file of WGSL under its name.
pub type Part = (&'static str, &'static str);

pub(crate) const RANDOM: Part = part!("common/random.wgsl");
const STEP: Part = part!("common/step.wgsl");
const COUNTERS: Part = part!("common/counters.wgsl");
const PROGRESS: Part = part!("common/progress.wgsl");
pub(crate) const RAY: Part = part!("common/ray.wgsl");
pub(crate) const SINE: Part = part!("common/sine.wgsl");
pub(crate) const CAMERA: Part = part!("common/camera.wgsl");
const RAY_LOAD: Part = part!("common/ray_load.wgsl");
const RAY_STORE: Part = part!("common/ray_store.wgsl");
const OCCUPANCY: Part = part!("common/occupancy.wgsl");
const MARCH_START: Part = part!("common/march_start.wgsl");
pub(crate) const EXP: Part = part!("common/exp.wgsl");
const SUM: Part = part!("common/sum.wgsl");
pub(crate) const DENSITY: Part = part!("common/density.wgsl");
const GRID: Part = part!("common/grid.wgsl");
const HARMONICS: Part = part!("common/harmonics.wgsl");
const USABLE: Part = part!("common/usable.wgsl");
const ADAM: Part = part!("common/adam.wgsl");
const COUNT_SAMPLES: Part = part!("layer/count_samples.wgsl");
const COUNT_KEPT: Part = part!("layer/count_kept.wgsl");

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

/// Indices of the dispatch sizes that kernels write.
pub mod dispatch {
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
    /// How many there are.
    pub const COUNT: usize = 5;
}

/// Added to the squared colour that an error is relative to, as in tiny-cuda-nn's RelativeL2.
pub const RELATIVE_FLOOR: f64 = 0.01;
/// Part of the photo's brightness that a rendered colour is at least taken for in relative errors.
const RELATIVE_DARKEST: f64 = 1e-3;

/// Least and most change of the length of all steps from one training step to the next.
const STEP_SHRINKAGE: f64 = 0.99;
const STEP_GROWTH: f64 = 1.02;

/// llvmpipe ends the loops of a thread after so many rounds together, without an error; ordered sums have one round
/// per kept sample.
const LONGEST_LOOP: usize = 65_535;

/// Everything that decides how kernels are linked.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The resolved configuration.
    pub config: Config,
    /// The parameters' layout.
    pub layout: Layout,
    /// What the scene needs.
    pub needs: Needs,
    /// How matrix products are written.
    pub product: layer::Product,
    /// How the table's gradients are summed.
    pub accumulation: Accumulation,
    /// Where tensors live.
    pub memory: Memory,
    /// Chunks of samples whose weight gradients are summed apart: what runs side by side.
    pub chunks: usize,
    /// How much of a view is in work at once.
    pub rounds: viewing::Rounds,
}

/// What a plan depends on of an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Traits {
    /// It runs on the CPU.
    pub is_cpu: bool,
    /// It adds floats atomically.
    pub float_atomics: bool,
    /// It has subgroups of a multiple of 8 threads.
    pub subgroups_of_8: bool,
    /// Where its tensors are fast.
    pub memory: Memory,
}

impl Traits {
    /// A usual GPU.
    pub const GPU: Self =
        Self { is_cpu: false, float_atomics: true, subgroups_of_8: true, memory: Memory::Buffers };

    /// Those of an adapter.
    #[must_use]
    pub fn of(gpu: &Gpu) -> Self {
        Self {
            is_cpu: gpu.is_cpu(),
            float_atomics: gpu.has(wgpu::Features::SHADER_FLOAT32_ATOMIC),
            subgroups_of_8: gpu.has_subgroups_of(8),
            memory: gpu.fast_memory(),
        }
    }
}

impl Plan {
    /// Chooses what depends on the adapter.
    #[must_use]
    pub fn new(gpu: &Gpu, config: Config, layout: Layout, needs: Needs) -> Self {
        Self::suited_to(Traits::of(gpu), config, layout, needs)
    }

    /// As [`Plan::new`], for an adapter that need not be there.
    #[must_use]
    pub fn suited_to(adapter: Traits, config: Config, layout: Layout, needs: Needs) -> Self {
        let orders = adapter.is_cpu && marching::kept_capacity(&config.batch) <= LONGEST_LOOP;
        let accumulation = match config.accumulation {
            Accumulation::Ordered if adapter.is_cpu && !orders => Accumulation::Fixed,
            Accumulation::Auto if orders => Accumulation::Ordered,
            Accumulation::Auto if config.deterministic => Accumulation::Fixed,
            Accumulation::Auto if adapter.float_atomics => Accumulation::Float,
            Accumulation::Auto => Accumulation::Exchange,
            chosen => chosen,
        };
        let shared_weights = adapter.is_cpu && adapter.subgroups_of_8;
        let rows = match (adapter.is_cpu, shared_weights) {
            (true, true) => 4,
            (true, false) => 4,
            (false, _) => 2,
        };
        let chunks = if adapter.is_cpu { 32 } else { 512 };
        let product = layer::Product { rows, shared_weights };
        let rounds = viewing::Rounds::suited_to(adapter);
        Self { config, layout, needs, product, accumulation, memory: adapter.memory, chunks, rounds }
    }

    /// The smallest step in box units.
    #[must_use]
    pub fn step_min(&self) -> f64 {
        3f64.sqrt() / f64::from(self.config.march.steps) / self.density_scale()
    }

    /// Inner cubes along the box: densities are per inner cube.
    #[must_use]
    pub fn density_scale(&self) -> f64 {
        f64::from(1u32 << (self.needs.cascades - 1))
    }

    /// Cells of the occupancy grid over all cascades.
    #[must_use]
    pub fn cell_count(&self) -> usize {
        (self.config.occupancy.cells as usize).pow(3) * self.needs.cascades as usize
    }

    /// Marched samples that a step aims at, so that they usually fit.
    #[must_use]
    pub fn target_samples(&self) -> usize {
        self.config.batch.samples / 8 * 7
    }

    /// Words that hold one bit per step of a ray.
    #[must_use]
    pub fn step_words(&self) -> usize {
        self.config.march.most_steps.div_ceil(32)
    }

    /// A kernel that links `parts` behind the plan's constants.
    ///
    /// # Errors
    /// As [`Kernel::new`].
    pub fn kernel(&self, gpu: &Gpu, label: &str, parts: &[Part]) -> Result<Kernel> {
        self.finish_kernel(gpu, self.source(label, parts), parts)
    }

    /// As [`Plan::kernel`], with one generated part and constants of its own.
    ///
    /// # Errors
    /// As [`Kernel::new`].
    pub fn generated_kernel(
        &self,
        gpu: &Gpu,
        label: &str,
        parts: &[Part],
        numbers: &[(&str, usize)],
        text: String,
    ) -> Result<Kernel> {
        let mut source = self.source(label, parts).part("generated", text);
        for (name, value) in numbers {
            source = source.count(name, *value);
        }
        self.finish_kernel(gpu, source, parts)
    }

    fn finish_kernel(&self, gpu: &Gpu, source: Source, parts: &[Part]) -> Result<Kernel> {
        let shared = [
            (STEP, Step::LAYOUT),
            (COUNTERS, Counters::LAYOUT),
            (PROGRESS, Progress::LAYOUT),
            (CAMERA, Camera::LAYOUT),
            (GRID, Level::LAYOUT),
        ];
        let layouts: Vec<_> =
            shared.iter().filter(|(part, _)| parts.contains(part)).map(|(_, layout)| *layout).collect();
        Kernel::new(gpu, &source, &layouts)
    }

    /// The text of a kernel, before it is linked. Cameras bring the lenses that the scene needs.
    #[must_use]
    pub fn source(&self, label: &str, parts: &[Part]) -> Source {
        let add = |source: Source, (name, text): &Part| source.part(name, *text);
        let source = self.numbers(self.dimensions(Source::new(label).memory(self.memory)));
        let source = parts.iter().fold(source, add);
        if !parts.contains(&CAMERA) {
            return source;
        }
        let lenses = &self.needs.lenses;
        lens::parts(lenses).iter().fold(source, add).part("lens choice", lens::choice(lenses))
    }

    fn dimensions(&self, source: Source) -> Source {
        let Self { config, layout, needs, .. } = self;
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
            ("SAMPLES_PER_THREAD", self.product.rows),
            ("CELLS", config.occupancy.cells as usize),
            ("CELL_COUNT", self.cell_count()),
            ("CASCADES", needs.cascades as usize),
            ("CAMERA_COUNT", needs.cameras.max(1)),
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
            ("DISPATCH_ENCODE", dispatch::ENCODE),
            ("DISPATCH_SAMPLE_TILES", dispatch::SAMPLE_TILES),
            ("DISPATCH_KEPT", dispatch::KEPT),
            ("DISPATCH_KEPT_TILES", dispatch::KEPT_TILES),
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
        let config = &self.config;
        let floats = [
            ("STEP_MIN", self.step_min()),
            ("STEP_MAX", 1.0 / f64::from(config.occupancy.cells)),
            ("CONE", config.march.cone),
            ("SAMPLES_PER_RAY", config.march.samples_per_ray),
            ("LONGEST_STEP", config.march.longest_step),
            ("STEP_SHRINKAGE", STEP_SHRINKAGE),
            ("STEP_GROWTH", STEP_GROWTH),
            ("DENSITY_SCALE", self.density_scale()),
            ("T_NEAR", config.march.near / self.density_scale()),
            ("LIGHT_SHARE", config.selection.light_share.max(1e-6)),
            ("STOP_TRANSMITTANCE", config.selection.stop_transmittance),
            ("COLOR_WEIGHT", self.rounds.color_weight(&self.needs)),
            ("OCCUPANCY_DECAY", config.occupancy.decay),
            ("OCCUPANCY_THRESHOLD", config.occupancy.threshold),
            ("BETA_1", config.optimizer.beta_1),
            ("BETA_2", config.optimizer.beta_2),
            ("EPSILON", config.optimizer.epsilon),
            ("L2", config.optimizer.l2),
            ("RELATIVE_FLOOR", RELATIVE_FLOOR),
            ("RELATIVE_DARKEST", RELATIVE_DARKEST),
            ("DEPTH_WEIGHT", config.loss.depth),
            ("DISTORTION", config.loss.distortion),
        ];
        let source = floats.iter().fold(source, |source, (name, value)| source.float(name, *value));
        let background = config.background.solid().map(|value| value / self.needs.grey);
        source.constant("BACKGROUND", vec3(background))
    }

    fn stepping(&self) -> Part {
        if self.needs.cascades > 1 { part!("stepping/cone.wgsl") } else { part!("stepping/uniform.wgsl") }
    }

    pub(crate) fn activation(&self) -> Part {
        if self.needs.hdr { part!("activation/exponential.wgsl") } else { part!("activation/sigmoid.wgsl") }
    }

    fn background(&self) -> Part {
        match self.config.background {
            Background::Random => part!("background/random.wgsl"),
            _ => part!("background/solid.wgsl"),
        }
    }

    /// Whether colour errors count relative to the colour.
    #[must_use]
    pub fn has_relative_loss(&self) -> bool {
        match self.config.loss.color {
            ColorLoss::Auto => self.needs.hdr,
            chosen => chosen == ColorLoss::Relative,
        }
    }

    fn loss(&self) -> Part {
        if self.has_relative_loss() { part!("loss/relative.wgsl") } else { part!("loss/squared.wgsl") }
    }

    fn depth_loss(&self) -> Part {
        if self.needs.depth { part!("depth_loss/squared.wgsl") } else { part!("depth_loss/none.wgsl") }
    }

    fn distortion(&self) -> Part {
        match self.config.loss.distortion > 0.0 {
            true => part!("distortion/pairs.wgsl"),
            false => part!("distortion/none.wgsl"),
        }
    }

    fn depth_target(&self) -> Part {
        if self.needs.depth { part!("depth_target/stored.wgsl") } else { part!("depth_target/none.wgsl") }
    }

    fn transmittance(&self) -> Part {
        match self.config.transmittance {
            Transmittance::Exclusive => part!("transmittance/exclusive.wgsl"),
            Transmittance::Inclusive => part!("transmittance/inclusive.wgsl"),
        }
    }

    /// The parts that add a gradient, and those that take the sum.
    fn gradient(&self) -> [Vec<Part>; 2] {
        let float = part!("gradient/take_float.wgsl");
        match self.accumulation {
            Accumulation::Fixed => {
                let scale = part!("gradient/fixed_scale.wgsl");
                let take = part!("gradient/take_fixed.wgsl");
                [vec![scale, part!("gradient/fixed.wgsl")], vec![COUNTERS, USABLE, scale, take]]
            }
            Accumulation::Float => [vec![part!("gradient/float.wgsl")], vec![float]],
            Accumulation::Exchange => [vec![part!("gradient/exchange.wgsl")], vec![float]],
            Accumulation::Auto | Accumulation::Ordered => {
                [vec![part!("scatter_ordered.wgsl")], vec![part!("gradient/take_ordered.wgsl")]]
            }
        }
    }
}

fn vec3(value: [f32; 3]) -> impl Display {
    let [x, y, z] = value;
    format!("vec3<f32>({x:?}, {y:?}, {z:?})")
}
