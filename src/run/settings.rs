//! The settings of a new run: a preset for the dataset and the adapter, what is asked for, and a batch that fits.

use super::options::TrainOptions;
use crate::capture::dataset::Dataset;
use crate::config::{Batch, Config};
use crate::field::capacity::SPARE_ROWS;
use crate::field::{Plan, SceneFeatures, Space};
use crate::gpu::Gpu;
use anyhow::Result;

/// Most times that the preset's batch is halved.
const MOST_HALVINGS: u32 = 4;

/// The settings of a new run.
#[derive(Clone, Debug)]
pub struct Settings {
    /// They themselves, with a finest level of the grid.
    pub config: Config,
    /// Kept samples of the preset's batch, where the adapter does not bind buffers for as many.
    pub usual_kept: Option<usize>,
}

impl Settings {
    /// A preset changed by `options`. Where they say nothing of the batch, it is halved until `gpu` binds its buffers.
    ///
    /// # Errors
    /// As [`TrainOptions::configure`].
    pub fn of(options: &TrainOptions, dataset: &Dataset, gpu: Option<&Gpu>) -> Result<Self> {
        let preset = Config::for_dataset(dataset, gpu.is_some_and(Gpu::is_cpu))?;
        let usual = preset.batch.clone();
        let config = options.configure(preset)?.with_finest(dataset);
        let is_asked_for = config.batch != usual;
        let Some(gpu) = gpu.filter(|_| !is_asked_for) else { return Ok(Self { config, usual_kept: None }) };
        let fits = |config: &Config| {
            let features = SceneFeatures::of_headers(dataset, config);
            let plan = |features| Plan::new(gpu, config.clone(), features, Space::from(&dataset.bounds));
            config.validate().is_ok() && features.is_ok_and(|features| plan(features).check(gpu).is_ok())
        };
        let smaller = |halvings| Config { batch: halved(&usual, halvings), ..config.clone() };
        let smaller = if fits(&config) { None } else { (0..=MOST_HALVINGS).map(smaller).find(fits) };
        // What no batch helps against is told by who needs it.
        let config = smaller.unwrap_or(config);
        let usual_kept = (config.batch.kept < usual.kept).then_some(usual.kept);
        Ok(Self { config, usual_kept })
    }
}

/// The batch halved so often. Buffers have spare rows behind the last sample, and adapters bind a power of two.
fn halved(batch: &Batch, halvings: u32) -> Batch {
    let [kept, samples, rays] = [batch.kept, batch.samples, batch.rays].map(|count| count >> halvings);
    Batch { kept, samples: samples - SPARE_ROWS, rays, first_rays: batch.first_rays.min(rays as u32) }
}
