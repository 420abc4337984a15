//! How much memory a training takes, on the device and on the host.

use crate::commands::Session;
use crate::commands::train::needs;
use crate::commands::train::setup::{cameras, defaults};
use anyhow::Result;
use nerf::camera::Bounds;
use nerf::camera::Camera;
use nerf::capture::dataset::Dataset;
use nerf::capture::health::Finding;
use nerf::config::Config;
use nerf::field::layout::finest_resolution;
use nerf::field::{Capabilities, Needs, Plan, Space};
use nerf::gpu::banks::Capacity;
use nerf::run::memory::Memory;

/// What a training with the settings for its adapter takes.
#[derive(Clone, Debug)]
pub(super) struct Estimate {
    /// Bytes.
    pub(super) memory: Memory,
    /// The adapter; without one, the settings are those of a GPU.
    pub(super) adapter: Option<String>,
    /// Whether device memory is host memory.
    pub(super) is_cpu: bool,
    /// Most bytes of photos that the adapter can bind.
    pub(super) most_photo_bytes: Option<u64>,
    /// Grid cells along an axis at the finest level, which follow the photos.
    pub(super) finest: u32,
    /// The parts of the program that stay out.
    pub(super) left_out: Vec<String>,
    /// Why it does not fit.
    excess: Option<String>,
}

impl Estimate {
    /// For the adapter of this session, or a usual GPU where there is none.
    pub(super) fn of(dataset: &Dataset, session: &Session<'_>) -> Result<Self> {
        // An adapter that was asked for must be there.
        let gpu = match session.open_gpu() {
            Err(error) if session.global.adapter.is_some() => return Err(error),
            opened => opened.ok(),
        };
        let traits = gpu.as_ref().map_or(Capabilities::GPU, |gpu| Capabilities::of(gpu));
        let cameras = cameras(dataset, &dataset.train);
        let config = defaults(traits.is_cpu, dataset)?;
        let needs = needs::of_headers(dataset, &config)?;
        let plan = plan(traits, config, needs, &dataset.bounds, &cameras);
        let memory = Memory::of_training(&plan, &cameras, dataset.stream_bytes(&dataset.train));
        let excess = gpu.as_ref().and_then(|gpu| memory.check(gpu, &plan).err());
        Ok(Self {
            memory,
            adapter: gpu.as_ref().map(|gpu| gpu.info.name.clone()),
            is_cpu: traits.is_cpu,
            most_photo_bytes: gpu.map(|gpu| Capacity::of(&gpu.device.limits(), plan.memory).bytes()),
            finest: plan.layout.levels.last().map_or(0, |level| level.resolution),
            left_out: plan.left_out(),
            excess: excess.map(|error| format!("{error:#}")),
        })
    }

    /// What does not fit, and what the estimate assumes.
    pub(super) fn problems(&self) -> Vec<Finding> {
        let assumed = "there is no adapter on this machine, which training needs: the memory is that of a GPU with the \
                       default settings; see `nerf adapters`";
        let excess = self.excess.iter().map(Finding::error);
        excess.chain(self.adapter.is_none().then(|| Finding::note(assumed))).collect()
    }
}

fn plan(traits: Capabilities, mut config: Config, needs: Needs, bounds: &Bounds, cameras: &[Camera]) -> Plan {
    let space = Space::from(bounds);
    config.grid.finest = finest_resolution(&config.grid, &space, cameras);
    Plan::suited_to(traits, config, needs, space)
}
