//! Datasets: posed photos in the `transforms.json` family of layouts.
//!
//! Opening one reads cameras and image headers; pixels are decoded on demand. World space is the
//! dataset's own, in its own units.

mod alpha_probe;
mod camera_list;
mod depth;
mod file_names;
mod folders;
mod guesses;
mod intrinsics;
mod json;
mod listing;
mod mask;
mod not_a_dataset;
pub(crate) mod notes;
mod open;
mod part;
mod photo_files;
mod photo_source;
mod pose;
mod prefetch;
mod resolved_frames;
mod search;
mod sidecars;
mod splits;
mod surfaces;
pub mod transforms;

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

use glam::DVec3;

use crate::camera::{Bounds, Camera};
use crate::capture::diagnostics::Diagnostic;
use crate::capture::focus;
use crate::photo::{BitDepth, Reading, Split};
pub use camera_list::{UsualView, read_cameras};
pub use file_names::{is_picture, with_extensions};
pub use intrinsics::Intrinsics;
pub use listing::{DepthEntry, DepthScale, FrameEntry, Listing, SceneBox};
pub use splits::{HoldOut, evenly_spaced, spread_order};

/// A dataset: what is listed, what was found, and what was assumed.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// Folder that the images are named from.
    pub root: PathBuf,
    /// The files that were read, the training frames' first.
    pub files: Vec<PathBuf>,
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
    /// Names of the listed frames whose images are missing or cannot be read.
    pub missing: Vec<String>,
    /// What is wrong with the images and masks whose headers cannot be read, a text for each kind, where
    /// [`allow_missing`](OpenOptions::allow_missing) let them pass.
    pub damaged: Vec<String>,
    /// Whether the images are scene-linear.
    pub is_hdr: bool,
    /// How finely the finest image is stored; every photo is loaded in this depth.
    pub bit_depth: BitDepth,
    /// How photos are read, with an alpha that is never [`AlphaMode::Auto`](crate::photo::AlphaMode::Auto).
    pub reading: Reading,
    /// Whether images are cut out: the first training image has transparent pixels.
    pub is_cutout: bool,
    /// What was assumed, repaired or looks wrong.
    pub notes: Vec<Diagnostic>,
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
    /// The camera, at the size that photos are loaded in: after the crop and the downscale.
    pub camera: Camera,
    /// Whether the photo has alpha, in its own file or in one beside it.
    pub has_alpha: bool,
    /// How finely the image file's pixels are stored.
    pub bits: BitDepth,
    /// Whether there is a mask.
    pub has_mask: bool,
    /// Whether there is a depth file.
    pub has_depth: bool,
    /// Whether the alpha is in the image file.
    has_own_alpha: bool,
    source: photo_source::PhotoSource,
}

impl Frame {
    /// Whether there is a mask whose black pixels are those to ignore.
    pub(crate) fn ignores_black(&self) -> bool {
        self.source.sidecars.masks.iter().any(|mask| mask.ignores == mask::Ignores::Black)
    }
}

/// Choices when opening a dataset.
#[derive(Clone, Debug, Default)]
pub struct OpenOptions {
    /// What to hold out where the dataset has no test or validation split.
    pub hold_out: HoldOut,
    /// Where no image at all is present: open the dataset all the same, with every listed frame and the
    /// sizes the file declares. Such a dataset cannot load images. Images that cannot be read are missing,
    /// too, and frames whose masks cannot be read are used without them; [`Dataset::damaged`] tells both.
    pub allow_missing: bool,
    /// How photos are read.
    pub reading: Reading,
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

    /// The cameras of some frames, in world space.
    #[must_use]
    pub fn cameras(&self, indices: &[usize]) -> Vec<Camera> {
        indices.iter().map(|&index| self.frames[index].camera.clone()).collect()
    }

    /// The indices of the frames called `names`, and the names that the dataset lacks.
    #[must_use]
    pub fn find<'a>(&self, names: &'a [String]) -> (Vec<usize>, Vec<&'a str>) {
        let frames = self.frames.iter().enumerate().rev();
        let indices: HashMap<_, _> = frames.map(|(index, frame)| (frame.name.as_str(), index)).collect();
        let mut missing = Vec::new();
        let mut found = Vec::new();
        for name in names {
            match indices.get(name.as_str()) {
                Some(&index) => found.push(index),
                None => missing.push(name.as_str()),
            }
        }
        (found, missing)
    }

    /// The files that it is read from: its own, photos, masks, alpha and depth.
    pub fn input_files<'a>(&'a self) -> impl Iterator<Item = &'a PathBuf> {
        let of_frame = |frame: &'a Frame| {
            let sidecars = &frame.source.sidecars;
            let depth = sidecars.depth.as_ref().map(|depth| &depth.path);
            let masks = sidecars.masks.iter().map(|mask| &mask.path);
            [Some(&frame.path), sidecars.alpha.as_ref(), depth].into_iter().flatten().chain(masks)
        };
        self.files.iter().chain(self.frames.iter().flat_map(of_frame))
    }

    /// Indices of the frames, each image once: splits may share images.
    pub(crate) fn distinct_images(&self) -> Vec<usize> {
        let mut seen = HashSet::new();
        (0..self.frames.len()).filter(|&index| seen.insert(&self.frames[index].path)).collect()
    }

    /// The scene's focus: the point nearest to the optical axes of all images, in world space. `None` where the axes
    /// do not cross.
    #[must_use]
    pub fn focus(&self) -> Option<DVec3> {
        let cameras = self.distinct_images().into_iter().map(|index| &self.frames[index].camera);
        let axes: Vec<_> = cameras.map(focus::OpticalAxis::of).collect();
        let found = (!axes.is_empty()).then(|| focus::find(&axes))?;
        (found.kind == focus::FocusKind::Crossing).then_some(found.point)
    }

    /// Number of different cameras: sizes, intrinsics and lenses, whatever the pose.
    pub fn distinct_cameras(&self) -> usize {
        let pose = glam::DAffine3::IDENTITY;
        let camera = |frame: &Frame| format!("{:?}", Camera { world_from_camera: pose, ..frame.camera });
        self.frames.iter().map(camera).collect::<HashSet<_>>().len()
    }
}
