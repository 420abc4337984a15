//! How much memory a training takes, on the device and on the host.

use crate::commands::train::setup::{cameras, defaults};
use crate::commands::{Session, needs};
use anyhow::Result;
use nerf::camera::Camera;
use nerf::config::Config;
use nerf::dataset::Dataset;
use nerf::gpu::banks::Capacity;
use nerf::gpu::demand::Demand;
use nerf::health::Finding;
use nerf::kernels::{Plan, Traits};
use nerf::model::{Layout, finest_resolution};
use nerf::render::Renderer;
use nerf::words::bytes;

/// What the program and the driver take before the first photo is decoded.
const PROCESS_BYTES: u64 = 256 << 20;

/// What a training with the settings for its adapter takes.
#[derive(Clone, Debug)]
pub(super) struct Memory {
    /// The adapter; without one, the settings are those of a GPU.
    pub(super) adapter: Option<String>,
    /// Whether device memory is host memory.
    pub(super) is_cpu: bool,
    /// Bytes of the photos on the device.
    pub(super) photos: u64,
    /// Bytes of parameters, gradients and samples on the device.
    pub(super) training: u64,
    /// Bytes of a renderer of test views on the device.
    pub(super) viewing: u64,
    /// Bytes on the host: the program, and photos being decoded.
    pub(super) host: u64,
    /// Most bytes of photos that the adapter can bind.
    pub(super) most_photos: Option<u64>,
    /// Grid cells along an axis at the finest level, which follow the photos.
    pub(super) finest: u32,
}

impl Memory {
    /// For the adapter of this session, or a usual GPU where there is none.
    pub(super) fn estimate(dataset: &Dataset, session: &Session<'_>) -> Result<Self> {
        // An adapter that was asked for must be there.
        let gpu = match session.open_gpu() {
            Err(error) if session.global.adapter.is_some() => return Err(error),
            opened => opened.ok(),
        };
        let traits = gpu.as_ref().map_or(Traits::GPU, |gpu| Traits::of(gpu));
        let config = defaults(traits.is_cpu, dataset)?;
        let cameras = cameras(dataset, &dataset.train);
        let plan = plan(traits, config, dataset, &cameras);
        let finest = plan.layout.levels.last().map_or(0, |level| level.resolution);
        let pixels = |camera: &Camera| camera.width as usize * camera.height as usize;
        let demands = plan.training_demands(plan.cell_count());
        Ok(Self {
            adapter: gpu.as_ref().map(|gpu| gpu.info.name.clone()),
            is_cpu: traits.is_cpu,
            photos: plan.photo_bytes(cameras.iter().map(pixels)),
            training: demands.iter().map(Demand::bytes).sum(),
            viewing: if dataset.test.is_empty() { 0 } else { Renderer::bytes(&plan) },
            host: PROCESS_BYTES + decoding(&cameras, dataset),
            most_photos: gpu.map(|gpu| Capacity::of(&gpu.device.limits(), plan.memory).bytes()),
            finest,
        })
    }

    /// Bytes on the device.
    pub(super) fn device(&self) -> u64 {
        self.photos + self.training + self.viewing
    }

    /// What does not fit, and what the estimate assumes.
    pub(super) fn problems(&self, dataset: &Dataset) -> Vec<Finding> {
        let mut problems = Vec::new();
        if let Some(most) = self.most_photos.filter(|&most| most < self.photos) {
            problems.push(Finding::error(format!(
                "the photos take {} on the device and the adapter can bind {}; train on fewer or smaller ones: \
                 --downscale 2, --crop or --max-images {}",
                bytes(self.photos),
                bytes(most),
                dataset.train.len() as u64 * most / self.photos
            )));
        }
        let wanted = self.host + self.device();
        if let Some(total) = host_total().filter(|&total| self.is_cpu && total < wanted) {
            problems.push(Finding::error(format!(
                "a training on this CPU takes {} and the machine has {}; train on fewer or smaller photos: \
                 --downscale 2, --crop or --max-images N",
                bytes(wanted),
                bytes(total)
            )));
        }
        if self.adapter.is_none() {
            problems.push(Finding::note(
                "there is no adapter on this machine: the memory is that of a training with the settings for a GPU; see \
                 `nerf adapters`",
            ));
        }
        problems
    }
}

fn plan(traits: Traits, mut config: Config, dataset: &Dataset, cameras: &[Camera]) -> Plan {
    if config.grid.finest == 0 {
        config.grid.finest = finest_resolution(config.grid.base, &dataset.bounds, cameras);
    }
    let layout = Layout::new(&config, config.grid.finest);
    Plan::suited_to(traits, config, layout, needs::of(dataset))
}

/// Bytes of all photos decoded at once.
fn decoding(cameras: &[Camera], dataset: &Dataset) -> u64 {
    let bytes = if dataset.is_hdr { 16 } else { 4 };
    cameras.iter().map(|camera| u64::from(camera.width) * u64::from(camera.height) * bytes).sum()
}

/// Bytes of memory of this machine, where Linux tells.
fn host_total() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? << 10)
}
