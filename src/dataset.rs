//! Datasets: posed photos in the `transforms.json` family of layouts.
//!
//! Opening one reads cameras and image headers; pixels are decoded on demand. World space is the
//! dataset's own, in its own units.

mod bounds;
pub(crate) mod focus;
mod frames;
mod intrinsics;
mod json;
mod notes;
mod open;
mod photo;
mod pose;
mod splits;
pub mod transforms;

use std::path::PathBuf;

use anyhow::{Result, ensure};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::image::Image;
pub use bounds::Bounds;
pub use intrinsics::Intrinsics;
pub use notes::{Note, Severity};
pub use open::read_cameras;
pub use photo::Photo;
pub use splits::HoldOut;

/// A dataset: what is listed, what was found, and what was assumed.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// Folder that the images are named from.
    pub root: PathBuf,
    /// Which family of tools wrote it.
    pub dialect: String,
    /// The frames whose images are present (all listed ones where
    /// [`allow_missing`](OpenOptions::allow_missing) applied), list by list, each in natural order of its
    /// names.
    pub frames: Vec<Frame>,
    /// Indices of the frames to train on; never an image that is tested on.
    pub train: Vec<usize>,
    /// Indices of the frames of the validation split.
    pub val: Vec<usize>,
    /// Indices of the frames to measure on: the test split, else the validation split, else held out.
    pub test: Vec<usize>,
    /// Number of frames listed, present or not.
    pub listed: usize,
    /// Names of the listed frames whose images are missing.
    pub missing: Vec<String>,
    /// Whether the images are scene-linear.
    pub is_hdr: bool,
    /// Whether images are cut out: the first training image has transparent pixels.
    pub is_cutout: bool,
    /// What was assumed, repaired or looks wrong.
    pub notes: Vec<Note>,
    /// The scene box.
    pub bounds: Bounds,
}

/// One frame of a dataset.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The image as the file names it, with forward slashes.
    pub name: String,
    /// The image file.
    pub path: PathBuf,
    /// The camera, at the image's own size.
    pub camera: Camera,
    /// Whether the image file has an alpha channel.
    pub has_alpha: bool,
}

/// A part of a dataset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Split {
    /// Trained on.
    Train,
    /// Looked at while training.
    Val,
    /// Measured on.
    Test,
}

/// Choices when opening a dataset.
#[derive(Clone, Copy, Debug, Default)]
pub struct OpenOptions {
    /// What to hold out where the dataset has no test or validation split.
    pub hold_out: HoldOut,
    /// Where no image at all is present: open the dataset all the same, with every listed frame and the
    /// sizes the file declares. Such a dataset cannot load images.
    pub allow_missing: bool,
}

impl Dataset {
    /// The indices of a split.
    pub fn split(&self, split: Split) -> &[usize] {
        match split {
            Split::Train => &self.train,
            Split::Val => &self.val,
            Split::Test => &self.test,
        }
    }

    /// Number of different cameras: sizes, intrinsics and lenses, whatever the pose.
    pub fn distinct_cameras(&self) -> usize {
        let mut distinct: Vec<Camera> = Vec::new();
        for frame in &self.frames {
            let camera = Camera { world_from_camera: glam::DAffine3::IDENTITY, ..frame.camera };
            if !distinct.contains(&camera) {
                distinct.push(camera);
            }
        }
        distinct.len()
    }

    /// Decodes the images of some frames, in their order, in parallel. `progress` is told each time how
    /// many are done, from any thread.
    pub fn load_images(&self, indices: &[usize], progress: &(dyn Fn(usize) + Sync)) -> Result<Vec<Image>> {
        let done = std::sync::atomic::AtomicUsize::new(0);
        let load = |&index: &usize| {
            let Frame { camera, path, .. } = &self.frames[index];
            let image = Image::load(path)?;
            ensure!(
                (image.width, image.height) == (camera.width, camera.height),
                "{} had {}x{} pixels when the dataset was opened and has {}x{} now; start again",
                path.display(),
                camera.width,
                camera.height,
                image.width,
                image.height
            );
            progress(1 + done.fetch_add(1, std::sync::atomic::Ordering::Relaxed));
            Ok(image)
        };
        indices.par_iter().map(load).collect()
    }
}
