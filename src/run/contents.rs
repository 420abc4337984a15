//! Whether a dataset is the one that a run was trained on. Its cameras and photos tell, not what it is called.

use crate::camera::{Camera, Geometry};
use crate::capture::dataset::{Dataset, Frame};
use crate::field::checkpoint::{FrameContents, Metadata, SplitNames};
use crate::photo::Reading;
use crate::support::fingerprint::fingerprint;
use crate::support::format::{few, length};
use anyhow::{Context, Result};
use glam::DVec2;
use rayon::prelude::*;
use std::collections::HashMap;

/// Cameras whose positions (as a share of the distance to the scene) and directions (in radians) differ by less are the same:
/// a file that was written again may have fewer digits.
const TOLERANCE: f64 = 1e-4;

impl FrameContents {
    /// Those of the frames of all `splits`; `None` where `dataset` lacks one.
    ///
    /// # Errors
    /// When a photo cannot be read.
    pub fn of(dataset: &Dataset, splits: &SplitNames) -> Result<Option<Self>> {
        let names: Vec<String> = splits.all().cloned().collect();
        let (frames, missing) = dataset.find(&names);
        if !missing.is_empty() {
            return Ok(None);
        }
        let photos = frames.par_iter().map(|&index| photo(&dataset.frames[index])).collect::<Result<_>>()?;
        Ok(Some(Self { cameras: dataset.cameras(&frames), photos }))
    }
}

fn photo(frame: &Frame) -> Result<u32> {
    fingerprint(&frame.path).with_context(|| format!("reading {}", frame.path.display()))
}

/// How frames of a dataset differ from what a run had under the same names.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Differences {
    /// Number of frames that were compared.
    compared: usize,
    /// Frames with other cameras.
    cameras: Vec<String>,
    /// How the first of them differs.
    first: String,
    /// Frames with other photos.
    photos: Vec<String>,
}

impl Differences {
    /// Compares frames of `dataset`. Nothing is compared with a run from before its contents were kept.
    ///
    /// # Errors
    /// When a photo cannot be read.
    pub fn between(metadata: &Metadata, dataset: &Dataset, frames: &[usize]) -> Result<Self> {
        let mut differences = Self::default();
        let Some(contents) = &metadata.contents else { return Ok(differences) };
        let places: HashMap<_, _> = metadata.splits.all().zip(0..).collect();
        let known = |index: &usize| {
            let frame = &dataset.frames[*index];
            places.get(&frame.name).map(|&place: &usize| (frame, place))
        };
        let known: Vec<_> = frames.iter().filter_map(known).collect();
        // Cameras in one place have no distance to their middle.
        let radius = metadata.orbit.radius.max(0.01 * metadata.bounds.half);
        let photos: Vec<u32> = known.par_iter().map(|(frame, _)| photo(frame)).collect::<Result<_>>()?;
        for ((frame, place), photo) in known.iter().zip(photos) {
            let (then, now) = (&contents.cameras[*place], &frame.camera);
            let is_read_alike = is_read_alike(&metadata.reading, &dataset.reading);
            if let Some(how) = difference(then, now, radius, is_read_alike) {
                differences.cameras.push(frame.name.clone());
                differences.first = if differences.first.is_empty() { how } else { differences.first };
            }
            if photo != contents.photos[*place] {
                differences.photos.push(frame.name.clone());
            }
        }
        differences.compared = known.len();
        Ok(differences)
    }

    /// What differs, as the beginning of a sentence; `None` where nothing does.
    #[must_use]
    pub fn describe(&self) -> Option<String> {
        let of = |names: &[String]| format!("{} of {} frames ({}", names.len(), self.compared, few(names));
        let cameras = format!("the cameras of {}; the first has {})", of(&self.cameras), self.first);
        let photos = format!("the photos of {})", of(&self.photos));
        match (self.cameras.is_empty(), self.photos.is_empty()) {
            (true, true) => None,
            (false, true) => Some(cameras),
            (true, false) => Some(photos),
            (false, false) => Some(format!("{cameras} and {photos}")),
        }
    }
}

/// Whether cameras are of the same part of the photos, at the same size.
fn is_read_alike(then: &Reading, now: &Reading) -> bool {
    (then.downscale, then.crop) == (now.downscale, now.crop)
}

/// What a camera has that it had not; `None` where it is the same. `radius` is the distance to the scene, in world units.
fn difference(then: &Camera, now: &Camera, radius: f64, is_read_alike: bool) -> Option<String> {
    let moved = then.position().distance(now.position());
    let axes = [then, now].map(|camera| camera.world_from_camera.matrix3);
    let turned = (0..3).map(|axis| axes[0].col(axis).distance(axes[1].col(axis))).fold(0.0, f64::max);
    let degrees = (2.0 * (0.5 * turned).min(1.0).asin()).to_degrees();
    let (is_moved, is_turned) = (moved > TOLERANCE * radius, turned > TOLERANCE);
    let of_size = |camera: &Camera| format!("{}x{}", camera.width, camera.height);
    match (is_moved, is_turned) {
        (true, true) => Some(format!("moved by {} and turned by {degrees:.1}°", length(moved))),
        (true, false) => Some(format!("moved by {}", length(moved))),
        (false, true) => Some(format!("turned by {degrees:.2}°")),
        (false, false) if !is_read_alike => None,
        (false, false) if of_size(then) != of_size(now) => {
            Some(format!("{} pixels instead of {}", of_size(now), of_size(then)))
        }
        (false, false) if sees_otherwise(then, now, radius) => {
            Some("another focal length or lens".to_owned())
        }
        (false, false) => None,
    }
}

/// Whether pixels of the one see along other rays than those of the other, wherever they stand.
fn sees_otherwise(then: &Camera, now: &Camera, radius: f64) -> bool {
    let now = Camera { world_from_camera: then.world_from_camera, ..*now };
    let size = DVec2::new(f64::from(then.width), f64::from(then.height));
    let places = [0.02, 0.5, 0.98];
    let pixels = places.iter().flat_map(|&x| places.iter().map(move |&y| DVec2::new(x, y) * size));
    let is_parallel = then.lens.geometry() == Geometry::Parallel;
    let differs = |pixel: DVec2| match (then.ray(pixel), now.ray(pixel)) {
        (Some(a), Some(b)) => {
            a.direction.distance(b.direction) > TOLERANCE
                || (is_parallel && a.origin.distance(b.origin) > TOLERANCE * radius)
        }
        (a, b) => a.is_some() != b.is_some(),
    };
    then.lens.kind() != now.lens.kind() || { pixels }.any(differs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Lens;
    use glam::{DAffine3, DVec3};
    use std::f64::consts::FRAC_PI_2;

    #[test]
    fn cameras_differ_by_what_they_see() {
        let camera = Camera {
            width: 800,
            height: 600,
            focal_px: DVec2::splat(900.0),
            center_px: DVec2::new(400.0, 300.0),
            lens: Lens::OpenCv { k: [0.1, 0.01, 0.0, 0.0], p: [0.0; 2] },
            world_from_camera: DAffine3::from_translation(DVec3::new(0.0, 0.0, 4.0)),
        };
        let to = |now: &Camera| difference(&camera, now, 4.0, true);
        let posed = |pose: DAffine3| Camera { world_from_camera: pose, ..camera };
        assert_eq!(to(&camera), None);
        let rounded = Camera { focal_px: DVec2::splat(900.001), ..camera };
        assert_eq!(to(&rounded), None, "fewer digits");
        let moved = posed(DAffine3::from_translation(DVec3::new(0.0, 0.3, 4.0)));
        assert_eq!(to(&moved).as_deref(), Some("moved by 0.300"));
        let quarter = posed(DAffine3::from_rotation_x(FRAC_PI_2) * camera.world_from_camera);
        assert_eq!(to(&quarter).as_deref(), Some("moved by 5.657 and turned by 90.0°"));
        let mirrored = posed(DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)) * camera.world_from_camera);
        assert_eq!(to(&mirrored).as_deref(), Some("turned by 180.00°"));
        let longer = Camera { focal_px: DVec2::splat(910.0), ..camera };
        let straight = Camera { lens: Lens::Pinhole, ..camera };
        let bent = Camera { lens: Lens::OpenCv { k: [0.1, 0.02, 0.0, 0.0], p: [0.0; 2] }, ..camera };
        for other in [longer, straight, bent] {
            assert_eq!(to(&other).as_deref(), Some("another focal length or lens"));
        }
        let half = camera.resized(400, 300);
        assert_eq!(to(&half).as_deref(), Some("400x300 pixels instead of 800x600"));
        assert_eq!(difference(&camera, &half, 4.0, false), None, "read at half the size");
    }
}
