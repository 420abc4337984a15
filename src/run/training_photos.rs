//! The training photos on their way from files to the device.

use super::event::{DepthTold, Event, Observer, Warning};
use super::memory::{MemoryUse, PhotoUse};
use crate::camera::Camera;
use crate::capture::dataset::Dataset;
use crate::capture::diagnostics::{NO_DEPTH_KNOWN, nothing_counts};
use crate::config::Config;
use crate::field::trainer::Trainer;
use crate::field::training_views::TrainingViews;
use crate::field::{Field, Plan, SceneFeatures, Space};
use crate::gpu::Gpu;
use crate::photo::Photo;
use anyhow::{Result, ensure};
use std::sync::Arc;

/// The photos that a field is trained on: some frames of a dataset.
#[derive(Clone, Copy, Debug)]
pub struct TrainingPhotos<'a> {
    /// Where they are.
    pub dataset: &'a Dataset,
    /// Indices of their frames.
    pub frames: &'a [usize],
}

impl<'a> TrainingPhotos<'a> {
    /// The dataset's own training frames.
    #[must_use]
    pub fn of(dataset: &'a Dataset) -> Self {
        Self { dataset, frames: &dataset.train }
    }

    /// Their cameras, in world space.
    #[must_use]
    pub fn cameras(&self) -> Vec<Camera> {
        self.dataset.cameras(self.frames)
    }

    /// What training on them takes of the host's memory and of the device's, which the host has too if `is_cpu`. The
    /// frames `tested` are measured.
    #[must_use]
    pub fn memory(&self, plan: &Plan, tested: &[usize], is_cpu: bool) -> MemoryUse {
        let Self { dataset, frames } = self;
        let trained = PhotoUse {
            cameras: &self.cameras(),
            stream_bytes: dataset.stream_bytes(frames, plan.features.depth),
        };
        let tested =
            PhotoUse { cameras: &dataset.cameras(tested), stream_bytes: dataset.stream_bytes(tested, false) };
        MemoryUse::of_training(plan, trained, tested, is_cpu)
    }

    /// Decodes them, a few at a time, and puts them on the device. Masks, alpha, depth and bits come along as far as
    /// the plan has them.
    ///
    /// # Errors
    /// When a file cannot be read, the device cannot hold the photos or its interrupt was raised, or they are not as the
    /// plan expects.
    pub fn load(&self, gpu: &Arc<Gpu>, plan: &Plan, observer: &mut dyn Observer) -> Result<TrainingViews> {
        self.load_beside(gpu, plan, &|_, _| {}, observer)
    }

    /// The same, with a `look` at each photo and the index of its frame.
    ///
    /// # Errors
    /// As [`TrainingPhotos::load`].
    pub fn load_beside(
        &self,
        gpu: &Arc<Gpu>,
        plan: &Plan,
        look: &dyn Fn(usize, &Photo),
        observer: &mut dyn Observer,
    ) -> Result<TrainingViews> {
        let (dataset, frames) = (self.dataset, self.frames);
        let mut views = TrainingViews::new(gpu, plan, &self.cameras())?;
        let mut ignored = Vec::new();
        let mut ignored_pixels = 0;
        let mut depths = DepthTold::default();
        observer.notice(&Event::Loading { done: 0, all: frames.len() });
        dataset.stream(frames, plan.features.depth, &mut |position, photo| {
            ignored_pixels += photo.count_ignored();
            if photo.is_ignored() {
                ignored.push(dataset.frames[frames[position]].name.as_str());
            }
            gpu.interrupt.check()?;
            look(frames[position], &photo);
            depths.add(&photo);
            views.add(&photo)?;
            observer.notice(&Event::Loading { done: position + 1, all: frames.len() });
            Ok(())
        })?;
        ensure!(ignored.len() < frames.len(), nothing_counts(frames.len(), dataset.reading.invert_masks));
        let masks = frames.iter().filter(|&&index| dataset.frames[index].has_mask).count();
        if masks > 0 && ignored_pixels == 0 {
            let inverted = dataset.reading.invert_masks;
            observer.notice(&Event::Warning(Warning::UselessMasks { masks, inverted }));
        }
        if plan.features.depth {
            ensure!(depths.known > 0.0, "loss.depth is above 0, and {NO_DEPTH_KNOWN}");
            observer.notice(&Event::Depth(depths));
        }
        if !ignored.is_empty() {
            let warning = Warning::IgnoredPhotos { names: &ignored, all: frames.len() };
            observer.notice(&Event::Warning(warning));
        }
        Ok(views)
    }
}

impl Plan {
    /// The plan of a training run on the training frames of `dataset`, whose grid is as fine as their pixels unless `config`
    /// says how fine.
    ///
    /// # Errors
    /// As [`SceneFeatures::of`].
    pub fn for_dataset(gpu: &Gpu, dataset: &Dataset, config: Config) -> Result<Self> {
        let config = config.with_finest(dataset);
        let features = SceneFeatures::of(dataset, &config)?;
        Ok(Self::new(gpu, config, features, Space::from(&dataset.bounds)))
    }
}

impl Trainer {
    /// A trainer on the training frames of `dataset`: everything that the photos have and `config` uses is linked, and
    /// all of them are on the device.
    ///
    /// # Errors
    /// When there is no frame to train on, a setting is out of range, a photo cannot be read, or the adapter cannot hold
    /// the run.
    pub fn on(gpu: &Arc<Gpu>, dataset: &Dataset, config: Config) -> Result<Self> {
        config.validate()?;
        let plan = Plan::for_dataset(gpu, dataset, config)?;
        let views = TrainingPhotos::of(dataset).load(gpu, &plan, &mut ())?;
        Self::new(Field::new(gpu, plan)?, views)
    }
}
