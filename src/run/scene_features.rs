//! From a dataset and a configuration to what a scene needs of the kernels: the one way there is.

use crate::camera::LensKind;
use crate::capture::dataset::{Dataset, Frame, evenly_spaced};
use crate::config::Config;
use crate::field::SceneFeatures;
use crate::photo::{BitDepth, Image};
use anyhow::{Result, ensure};

/// Photos that the brightness of a linear scene is measured on.
const PHOTOS_FOR_GREY: usize = 8;
pub(super) const NO_FRAME: &str = "the dataset has no frame to train on";

impl SceneFeatures {
    /// What training on the training frames of `dataset` needs. A few photos of a linear dataset are decoded for it.
    ///
    /// # Errors
    /// When there is no frame to train on, a photo cannot be read, or photos are no use to what `config` asks for.
    pub fn of(dataset: &Dataset, config: &Config) -> Result<Self> {
        ensure!(!dataset.train.is_empty(), NO_FRAME);
        Ok(Self { grey: grey(dataset)?, ..Self::of_headers(dataset, config)? })
    }

    /// As [`SceneFeatures::of`], without looking at photos: their brightness is taken for 1.
    ///
    /// # Errors
    /// When `config` asks for what the photos do not have.
    pub fn of_headers(dataset: &Dataset, config: &Config) -> Result<Self> {
        let used = dataset.train.iter().chain(&dataset.test);
        let features = Self {
            lenses: LensKind::among(used.map(|&index| &dataset.frames[index].camera)),
            hdr: dataset.is_hdr,
            grey: 1.0,
            ..Self::default()
        };
        features.for_photos(dataset, &dataset.train, config)
    }

    /// These with what a record of a photo's pixel must hold, for the photos of some frames. It may differ from one
    /// session of a run to the next: somebody may have added masks, alpha or depth.
    ///
    /// # Errors
    /// When depth is asked for and not there.
    pub fn for_photos(self, dataset: &Dataset, frames: &[usize], config: &Config) -> Result<Self> {
        let any =
            |condition: fn(&Frame) -> bool| frames.iter().any(|&index| condition(&dataset.frames[index]));
        let has_depth = any(|frame| frame.has_depth);
        ensure!(
            has_depth || config.loss.depth == 0.0,
            "loss.depth is {}, and no training frame has a depth file; name them by `depth_file_path`, or set it to 0",
            config.loss.depth
        );
        Ok(Self {
            alpha: any(|frame| frame.has_alpha),
            deep: dataset.bit_depth == BitDepth::Sixteen,
            masks: any(|frame| frame.has_mask),
            depth: has_depth && config.loss.depth > 0.0,
            ..self
        })
    }
}

/// Brightness of a typical pixel of linear photos, which the field then takes for 1; 1 for others.
fn grey(dataset: &Dataset) -> Result<f32> {
    if !dataset.is_hdr {
        return Ok(1.0);
    }
    let few = evenly_spaced(&dataset.train, PHOTOS_FOR_GREY);
    let mut logs = Vec::with_capacity(few.len());
    dataset.stream(&few, false, &mut |_, photo| {
        logs.extend(Image::grey(&photo.image).map(f64::ln));
        Ok(())
    })?;
    let grey = (logs.iter().sum::<f64>() / logs.len().max(1) as f64).exp() as f32;
    ensure!(
        SceneFeatures::GREY.contains(&grey),
        "the photos are as dark or as bright as {grey:e}; scale them to about 1"
    );
    Ok(grey)
}
