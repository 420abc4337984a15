//! How much memory training on a dataset would take, before anything is loaded.

use super::memory::MemoryUse;
use super::training_photos::TrainingPhotos;
use crate::capture::dataset::Dataset;
use crate::config::Config;
use crate::field::{Capabilities, Plan, SceneFeatures, Space};
use crate::gpu::Gpu;
use crate::gpu::paged_array::PageCapacity;
use anyhow::Result;

/// What a training run with the settings for its adapter takes.
#[derive(Debug)]
pub struct Estimate {
    /// Bytes.
    pub memory: MemoryUse,
    /// The adapter; without one, the settings are those of a GPU.
    pub adapter: Option<String>,
    /// Whether device memory is host memory.
    pub is_cpu: bool,
    /// Most bytes of photos that the adapter can bind.
    pub most_photo_bytes: Option<u64>,
    /// Grid cells along an axis at the finest level, which follow the photos.
    pub finest: u32,
    /// The parts of the program that stay out.
    pub left_out: Vec<String>,
    /// Why it does not fit.
    pub excess: Option<anyhow::Error>,
}

impl Estimate {
    /// For a training run with these settings on the training frames of `dataset`, on `gpu` or on a usual GPU where there
    /// is none.
    ///
    /// # Errors
    /// When the settings ask for what the photos do not have.
    pub fn of(dataset: &Dataset, gpu: Option<&Gpu>, config: Config) -> Result<Self> {
        let adapter = gpu.map_or(Capabilities::GPU, Capabilities::of);
        let config = config.with_finest(dataset);
        let features = SceneFeatures::of_headers(dataset, &config)?;
        let plan = Plan::suited_to(adapter, config, features, Space::from(&dataset.bounds));
        let memory = TrainingPhotos::of(dataset).memory(&plan, &dataset.test, adapter.is_cpu);
        let excess = gpu.and_then(|gpu| {
            let shortage = || memory.check_host(adapter.is_cpu).map_err(|shortage| memory.refusal(shortage));
            memory.check_device(gpu, &plan).and_then(|()| shortage()).err()
        });
        Ok(Self {
            memory,
            adapter: gpu.map(|gpu| gpu.info.name.clone()),
            is_cpu: adapter.is_cpu,
            most_photo_bytes: gpu.map(|gpu| PageCapacity::of(&gpu.device.limits(), plan.memory).bytes()),
            finest: plan.layout.levels.last().map_or(0, |level| level.resolution),
            left_out: plan.left_out(),
            excess,
        })
    }
}
