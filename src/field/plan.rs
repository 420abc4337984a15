//! The list of kernels: which parts each one links, which buffers it is given, in which order they run.
//!
//! Parts for what a scene does not need (a lens, cascades, alpha, …) are not linked, their buffers are not
//! allocated and their stages are not dispatched.

use super::{Link, SceneFeatures, Workspace, layer, march, shared, viewing};
use crate::config::{Accumulation, ColorLoss, Config};
use crate::field::parameters::Layout;
use crate::gpu::Gpu;
use crate::gpu::kernel::Kernel;
use crate::gpu::pass::Stage;
use crate::gpu::tensor::Memory;
use crate::support::file::write_atomically;
use anyhow::{Result, ensure};
use std::io::Write;
use std::path::Path;

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
    pub needs: SceneFeatures,
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
    pub fn new(gpu: &Gpu, config: Config, layout: Layout, needs: SceneFeatures) -> Self {
        Self::suited_to(Traits::of(gpu), config, layout, needs)
    }

    /// As [`Plan::new`], for an adapter that need not be there.
    #[must_use]
    pub fn suited_to(adapter: Traits, config: Config, layout: Layout, needs: SceneFeatures) -> Self {
        let orders = adapter.is_cpu && march::kept_capacity(&config.batch) <= LONGEST_LOOP;
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

    /// A kernel behind the plan's constants, its structs compared with Rust's. The folder that the environment variable
    /// NERF_DUMP_SHADERS names gets its text.
    ///
    /// # Errors
    /// As [`Kernel::new`], or when that folder cannot be written to.
    pub fn kernel(&self, gpu: &Gpu, link: &Link) -> Result<Kernel> {
        let source = self.source(link)?;
        if let Some(folder) = std::env::var_os("NERF_DUMP_SHADERS") {
            let path = Path::new(&folder).join(format!("{}.wgsl", link.label().replace(' ', "_")));
            write_atomically(&path, |file| Ok(file.write_all(source.text().as_bytes())?))?;
        }
        Kernel::new(gpu, &source, shared::LAYOUTS)
    }

    /// A kernel over the rays, bound to what it uses.
    pub(crate) fn ray_stage(&self, gpu: &Gpu, workspace: &Workspace, link: &Link) -> Result<Stage> {
        let bound = workspace.bind(gpu, &self.kernel(gpu, link)?, &[])?;
        Ok(Stage::indirect(bound, workspace.get("dispatch"), dispatch::RAYS))
    }

    /// Whether colour errors count relative to the colour.
    #[must_use]
    pub fn has_relative_loss(&self) -> bool {
        match self.config.loss.color {
            ColorLoss::Auto => self.needs.hdr,
            chosen => chosen == ColorLoss::Relative,
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
