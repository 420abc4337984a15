//! What files of a dataset tell about where the surfaces of its scene are.

use super::Frame;
use super::notes::Notes;
use super::splits::evenly_spaced;
use crate::camera::Camera;
use crate::capture::surfaces::Surfaces;
use crate::support::statistics::median;
use glam::{DVec2, DVec3};
use std::path::Path;

/// Depth beyond the median by this factor may stand for far away.
const STAND_IN: f64 = 10.0;
/// Depth files that are looked at.
const DEPTH_FILES: usize = 12;
/// Pixels along either side of one.
const SIDE: u32 = 24;

/// The point cloud that a dataset names, if it is of use.
pub(super) fn of_cloud(root: &Path, named: &str, cameras: &[&Camera], notes: &mut Notes) -> Option<Surfaces> {
    let bare = Path::new(named).file_name().unwrap_or_default();
    let Some(path) = [root.join(named), root.join(bare)].into_iter().find(|path| path.is_file()) else {
        notes.note(format!("the point cloud {named} that `ply_file_path` names is missing"));
        return None;
    };
    let surfaces = Surfaces::of_cloud(&path, cameras);
    surfaces.map_err(|error| notes.warn(format!("the point cloud is not used: {error:#}"))).ok()
}

/// What the depth of some of `frames` shows; `None` where it tells nothing.
pub(super) fn of_depth(frames: &[&Frame]) -> Option<Surfaces> {
    let with_depth: Vec<&Frame> = frames.iter().copied().filter(|frame| frame.has_depth).collect();
    let seen: Vec<Seen> = evenly_spaced(&with_depth, DEPTH_FILES).into_iter().flat_map(seen_by).collect();
    let most = STAND_IN * median(seen.iter().map(|seen| seen.depth))?;
    Surfaces::of_depth(seen.iter().filter(|seen| seen.depth <= most).map(|seen| seen.place).collect())
}

/// A place in world space, and its depth.
struct Seen {
    place: DVec3,
    depth: f64,
}

/// The places behind a grid of pixels, as far as their depth is known. That it cannot be read comes up elsewhere.
fn seen_by(frame: &Frame) -> Vec<Seen> {
    let Ok(depth) = frame.unlimited_depth() else { return Vec::new() };
    let camera = &frame.camera;
    let place = |cell: u32| {
        let [x, y] = [(cell % SIDE) * camera.width / SIDE, (cell / SIDE) * camera.height / SIDE];
        let pixel = y as usize * camera.width as usize + x as usize;
        let depth = f64::from(*depth.get(pixel).filter(|depth| **depth > 0.0 && depth.is_finite())?);
        Some(Seen { place: camera.point(DVec2::new(f64::from(x), f64::from(y)) + 0.5, depth)?, depth })
    };
    (0..SIDE * SIDE).filter_map(place).collect()
}
