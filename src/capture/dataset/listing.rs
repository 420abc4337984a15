//! What a file of a dataset lists, before any image is looked for.

use super::intrinsics::Intrinsics;
use super::notes::Notes;
use crate::capture::diagnostics::Diagnostic;
use crate::capture::image_file::ColorKey;
use crate::photo::Split;
use glam::{DAffine3, DVec3};

/// One parsed file.
#[derive(Debug)]
pub struct Listing {
    /// The frames in the order of the file.
    pub frames: Vec<FrameEntry>,
    /// The scene box of instant-ngp's keys, if the file has one of them.
    pub scene_box: Option<SceneBox>,
    /// A point cloud of the scene in the same coordinates, as the file spells it, with forward slashes.
    pub point_cloud: Option<String>,
    /// Which family of tools writes such files.
    pub dialect: &'static str,
    pub(super) notes: Notes,
}

/// One frame as listed.
#[derive(Clone, Debug)]
pub struct FrameEntry {
    /// `frame 3 'images/0004.png'`, for messages; counts from 0.
    pub label: String,
    /// The image, as the file spells it, with forward slashes.
    pub file_path: String,
    /// Focal length, principal point and lens.
    pub intrinsics: Intrinsics,
    /// Camera-to-world pose: an orthonormal matrix, improper where the world is left-handed, and a position.
    pub world_from_camera: DAffine3,
    /// The split that the file's own lists put the frame in.
    pub split: Option<Split>,
    /// Its mask as the file spells it, with forward slashes; black pixels of it are ignored.
    pub mask_path: Option<String>,
    /// Its depth file.
    pub depth: Option<DepthEntry>,
    /// The colours that are transparent.
    pub(super) color_key: ColorKey,
}

impl Listing {
    /// What is to be said about how the file was read.
    pub fn notes(&self) -> Vec<Diagnostic> {
        self.notes.clone().finish()
    }
}

/// A depth file as a frame lists it.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthEntry {
    /// The file, as the frame spells it, with forward slashes.
    pub path: String,
    /// What its numbers mean.
    pub scale: DepthScale,
}

/// What the numbers of a depth file mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthScale {
    /// World units per step of a file of whole numbers; `None` if the dataset does not say.
    pub steps: Option<f64>,
    /// World units per unit of a file of floats.
    pub lengths: f64,
}

/// A scene box in instant-ngp's terms: `world * scale + offset` maps the inner cube to `[0, 1]³`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneBox {
    /// Unit-cube lengths per world unit.
    pub scale: f64,
    /// Where the world's origin lies in the unit cube.
    pub offset: DVec3,
    /// Side of the whole box in inner cubes: a power of two, 1 to 128.
    pub aabb_scale: u32,
}
