//! What a workbench is built from.

use super::inputs::SEED;
use crate::camera::Bounds;
use crate::config::Transmittance;
use crate::config::{Accumulation, Batch, Config, Grid, March, Network, Occupancy, Optimizer, Selection};
use crate::field::layer::Product;
use crate::field::{Plan, SceneFeatures, Space};
use crate::gpu::Gpu;
use crate::gpu::tensor::TensorMemory;
use anyhow::Result;
use glam::DVec3;

/// What a [`super::Workbench`] is built from.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Sizes and constants of the field.
    pub config: Config,
    /// What the scene needs.
    pub features: SceneFeatures,
    /// The scene's box.
    pub bounds: Bounds,
    /// How matrix products are written; `None` as the plan chooses.
    pub product: Option<Product>,
    /// Where tensors live; `None` as the plan chooses.
    pub memory: Option<TensorMemory>,
    /// Threads that march a ray together; `None` as the plan chooses.
    pub march_lanes: Option<usize>,
}

impl Setup {
    /// A tiny field: 8 levels, dense and hashed, networks of width 16, 16³ cells, everything kept, and
    /// gradients left as Adam's first moments.
    #[must_use]
    pub fn tiny() -> Self {
        let config = Config {
            grid: Grid { levels: 8, base: 4, finest: 40, log2_table: 9 },
            network: Network { width: 16, color_layers: 1 },
            march: March {
                steps: 64,
                cone: 1.0 / 32.0,
                most_steps: 96,
                near: 0.05,
                longest_step: 1.0,
                ..March::default()
            },
            occupancy: Occupancy { cells: 16, ..Occupancy::default() },
            batch: Batch { kept: 256, samples: 512, rays: 256, first_rays: 64 },
            selection: Selection { weight_floor: 0.0, light_share: 1.0, stop_transmittance: 0.0 },
            optimizer: Optimizer { beta_1: 0.0, l2: 0.0, ..Optimizer::default() },
            seed: SEED,
            ..Config::default()
        };
        let features = SceneFeatures { alpha: true, ..SceneFeatures::default() };
        let bounds = Bounds {
            center: DVec3::splat(0.5),
            half: 0.5,
            cascades: 1,
            source: "unit cube".into(),
            is_guess: false,
        };
        Self { config, features, bounds, product: None, memory: None, march_lanes: None }
    }

    /// With hidden layers of `width`, `color_layers` of them in the colour network.
    #[must_use]
    pub fn network(mut self, width: usize, color_layers: usize) -> Self {
        self.config.network = Network { width, color_layers };
        self
    }

    /// With this many cubes, the inner one the unit cube of the world.
    #[must_use]
    pub fn cascades(mut self, cascades: u32) -> Self {
        self.bounds.cascades = cascades;
        self
    }

    /// With linear light where `hdr`.
    #[must_use]
    pub fn hdr(mut self, hdr: bool) -> Self {
        self.features.hdr = hdr;
        self
    }

    /// With the table's gradients summed in this way.
    #[must_use]
    pub fn accumulation(mut self, accumulation: Accumulation) -> Self {
        self.config.accumulation = accumulation;
        self
    }

    /// In this convention.
    #[must_use]
    pub fn transmittance(mut self, transmittance: Transmittance) -> Self {
        self.config.transmittance = transmittance;
        self
    }

    /// The plan on `gpu`.
    ///
    /// # Errors
    /// When the configuration is out of range.
    pub fn plan(&self, gpu: &Gpu) -> Result<Plan> {
        self.config.validate()?;
        let space = Space::from(&self.bounds);
        let mut plan = Plan::new(gpu, self.config.clone(), self.features.clone(), space);
        plan.product = self.product.unwrap_or(plan.product);
        plan.memory = self.memory.unwrap_or(plan.memory);
        plan.march_lanes = self.march_lanes.unwrap_or(plan.march_lanes);
        Ok(plan)
    }
}
