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
mod constants;
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

pub use constants::{RELATIVE_FLOOR, STEP_GROWTH, STEP_SHRINKAGE, dimension};
pub use needs::Needs;
pub use shared::{Camera, Counters, Progress, RayResult, RayTarget, Step};
pub use workspace::Workspace;

use crate::config::{Accumulation, Background, ColorLoss, Config, Transmittance};
use crate::gpu::Gpu;
use crate::gpu::kernel::{Kernel, Shared};
use crate::gpu::pass::Stage;
use crate::gpu::source::Source;
use crate::gpu::tensor::Memory;
use crate::model::{Layout, Level};
use anyhow::{Result, ensure};

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
const RAY_TARGET: Part = part!("common/ray_target.wgsl");
const RAY_RESULT: Part = part!("common/ray_result.wgsl");
const KEPT_LOAD: Part = part!("common/kept_load.wgsl");
const VIEW_RAY: Part = part!("common/view_ray.wgsl");
const OCCUPANCY: Part = part!("common/occupancy.wgsl");
const OCCUPANCY_RAISE: Part = part!("common/occupancy_raise.wgsl");
const MARCH_START: Part = part!("common/march_start.wgsl");
pub(crate) const EXP: Part = part!("common/exp.wgsl");
const LOG: Part = part!("common/log.wgsl");
const SUM: Part = part!("common/sum.wgsl");
pub(crate) const DENSITY: Part = part!("common/density.wgsl");
const GRID: Part = part!("common/grid.wgsl");
const HARMONICS: Part = part!("common/harmonics.wgsl");
const USABLE: Part = part!("common/usable.wgsl");
const ADAM: Part = part!("common/adam.wgsl");
const COUNT_SAMPLES: Part = part!("layer/count_samples.wgsl");
const COUNT_KEPT: Part = part!("layer/count_kept.wgsl");

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

    /// Whether an adapter called `name` can sum gradients like this.
    ///
    /// # Errors
    /// When it cannot: says why, and what to take instead.
    pub fn check(&self, accumulation: Accumulation, name: &str) -> Result<()> {
        ensure!(
            accumulation != Accumulation::Ordered || self.is_cpu,
            "ordered accumulation adds all gradients of a grid level in one thread: on a GPU like '{name}' a step would \
             take seconds; leave it out, or ask for fixed, whose sum is the same in every run too"
        );
        ensure!(
            accumulation != Accumulation::Float || self.float_atomics,
            "float accumulation needs atomic addition of floats, and the adapter '{name}' does not have it; leave it \
             out, or ask for exchange or fixed"
        );
        Ok(())
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
            (RAY_TARGET, RayTarget::LAYOUT),
            (RAY_RESULT, RayResult::LAYOUT),
            (CAMERA, Camera::LAYOUT),
            (GRID, Level::LAYOUT),
        ];
        let layouts: Vec<_> =
            shared.iter().filter(|(part, _)| parts.contains(part)).map(|(_, layout)| *layout).collect();
        Kernel::new(gpu, &source, &layouts)
    }

    /// A kernel over the rays, bound to what it uses.
    fn ray_stage(&self, gpu: &Gpu, workspace: &Workspace, label: &str, parts: &[Part]) -> Result<Stage> {
        let bound = workspace.bind(gpu, &self.kernel(gpu, label, parts)?, &[])?;
        Ok(Stage::indirect(bound, workspace.get("dispatch"), dispatch::RAYS))
    }

    /// The text of a kernel, before it is linked. Cameras bring the lenses that the scene needs.
    #[must_use]
    pub fn source(&self, label: &str, parts: &[Part]) -> Source {
        let add = |source: Source, (name, text): &Part| source.part(name, *text);
        let source = self.constants(Source::new(label).memory(self.memory));
        let source = parts.iter().fold(source, add);
        if !parts.contains(&CAMERA) {
            return source;
        }
        let lenses = &self.needs.lenses;
        lens::parts(lenses).iter().fold(source, add).part("lens choice", lens::choice(lenses))
    }

    fn stepping(&self) -> &'static [Part] {
        match self.needs.cascades > 1 {
            true => &[LOG, part!("stepping/cone.wgsl")],
            false => &[part!("stepping/uniform.wgsl")],
        }
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

    /// The distance of a kept sample, where the loss has use for it.
    fn distance(&self) -> &'static [Part] {
        match self.needs.depth || self.config.loss.distortion > 0.0 {
            true => &[RAY, RAY_LOAD, part!("distance/along.wgsl")],
            false => &[part!("distance/none.wgsl")],
        }
    }

    fn distortion(&self) -> Part {
        match self.config.loss.distortion > 0.0 {
            true => part!("distortion/pairs.wgsl"),
            false => part!("distortion/none.wgsl"),
        }
    }

    fn sparsity(&self) -> &'static [Part] {
        match self.config.loss.sparsity > 0.0 {
            true => &[LOG, part!("sparsity/logarithm.wgsl")],
            false => &[part!("sparsity/none.wgsl")],
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adapters_refuse_sums_that_do_not_suit_them() {
        let modest = Traits { float_atomics: false, ..Traits::GPU };
        let software = Traits { is_cpu: true, ..modest };
        let refusal = |adapter: Traits, accumulation| {
            adapter.check(accumulation, "it").err().map(|error| error.to_string()).unwrap_or_default()
        };
        assert!(refusal(Traits::GPU, Accumulation::Ordered).contains("one thread"));
        assert!(refusal(modest, Accumulation::Float).contains("exchange or fixed"));
        for accumulation in [Accumulation::Exchange, Accumulation::Fixed] {
            assert_eq!(refusal(modest, accumulation), "");
        }
        assert_eq!(refusal(Traits::GPU, Accumulation::Float) + &refusal(software, Accumulation::Ordered), "");
    }
}
