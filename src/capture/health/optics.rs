//! Focal lengths, fields of view, principal points and lenses, and whether they agree.

use super::{CameraSet, Diagnostic, Spread};
use crate::camera::{Camera, Geometry, LensKind};
use crate::support::format::{count, percent};
use glam::{DVec2, dvec2};
use std::collections::BTreeMap;

/// The optics of all views.
#[derive(Clone, Debug)]
pub struct Optics {
    /// Lens models and how many views have each, most first.
    pub lenses: Vec<(LensKind, usize)>,
    /// Sizes in pixels and how many views have each, most first.
    pub sizes: Vec<([u32; 2], usize)>,
    /// Focal lengths along x and y, in pixels.
    pub focal_px: [Spread; 2],
    /// Fields of view along x and y, in degrees.
    pub fov_degrees: [Spread; 2],
    /// How far the principal point lies right of the middle and below it, as parts of width and height.
    pub center_off: [Spread; 2],
}

/// Frames whose focal length is within this of each other were taken at one setting.
const SAME_FOCAL: f64 = 0.01;
/// A focal length this far from that of nearly all frames of the same size is not noise of a calibration.
const OTHER_FOCAL: f64 = 0.03;
/// More frames than this were zoomed on purpose.
const FEW: f64 = 0.15;
/// Pixels are square.
const SQUARE: f64 = 0.02;
/// Aerial teles see 6° to 12°.
const LEAST_FOV_DEGREES: f64 = 5.0;
const MOST_FOV_DEGREES: f64 = 150.0;
/// Farther off the middle, a picture was cropped or the numbers belong to another size.
const FAR_OFF: f64 = 0.25;

impl Optics {
    pub(super) fn of(scene: &CameraSet<'_>) -> Self {
        let spread = |value: &dyn Fn(&Camera) -> f64| Spread::of(scene.cameras().map(value));
        let center_off = |axis: usize| spread(&|camera| center_off(camera)[axis]);
        Self {
            lenses: counted(scene.cameras().map(|camera| camera.lens.kind())),
            sizes: counted(scene.cameras().map(|camera| [camera.width, camera.height])),
            focal_px: [spread(&|camera| camera.focal_px.x), spread(&|camera| camera.focal_px.y)],
            fov_degrees: [spread(&|camera| fov_degrees(camera).x), spread(&|camera| fov_degrees(camera).y)],
            center_off: [center_off(0), center_off(1)],
        }
    }

    pub(super) fn findings(&self, scene: &CameraSet<'_>) -> Vec<Diagnostic> {
        [odd_focal_lengths(scene), oblong_pixels(scene), odd_fields_of_view(scene), far_off_centers(scene)]
            .into_iter()
            .flatten()
            .collect()
    }
}

/// Different things with their numbers, the most frequent first.
fn counted<T: Ord>(things: impl Iterator<Item = T>) -> Vec<(T, usize)> {
    let mut numbers = BTreeMap::new();
    things.for_each(|thing| *numbers.entry(thing).or_insert(0) += 1);
    let mut counted: Vec<_> = numbers.into_iter().collect();
    counted.sort_by_key(|(_, number)| std::cmp::Reverse(*number));
    counted
}

fn size(camera: &Camera) -> DVec2 {
    dvec2(f64::from(camera.width), f64::from(camera.height))
}

/// How far the principal point lies from the middle, in parts of the picture.
fn center_off(camera: &Camera) -> DVec2 {
    camera.center_px / size(camera) - 0.5
}

/// The angles that a picture spans along its middle row and column.
fn fov_degrees(camera: &Camera) -> DVec2 {
    let size = size(camera);
    let half = |rim: DVec2| {
        let rays = camera.ray(0.5 * size).zip(camera.ray(rim * size));
        // Without the lens where it has no rays there.
        let ideal = || ((rim - 0.5) * size / camera.focal_px).abs().max_element().atan();
        rays.map_or_else(ideal, |(middle, rim)| middle.direction.angle_between(rim.direction)).to_degrees()
    };
    dvec2(half(dvec2(0.0, 0.5)) + half(dvec2(1.0, 0.5)), half(dvec2(0.5, 0.0)) + half(dvec2(0.5, 1.0)))
}

fn is_flat(camera: &Camera) -> bool {
    camera.lens.geometry() == Geometry::Plane
}

fn odd_focal_lengths(scene: &CameraSet<'_>) -> Option<Diagnostic> {
    let mut odd = Vec::new();
    let mut told = None;
    let cameras: Vec<&Camera> = scene.cameras().collect();
    for (kind, _) in counted(cameras.iter().map(|camera| ([camera.width, camera.height], camera.lens.kind())))
    {
        let is_alike = |camera: &Camera| ([camera.width, camera.height], camera.lens.kind()) == kind;
        let group: Vec<usize> = (0..cameras.len()).filter(|&view| is_alike(cameras[view])).collect();
        let middle = Spread::of(group.iter().map(|&view| cameras[view].focal_px.x)).median;
        let off = |view: &usize| (cameras[*view].focal_px.x / middle - 1.0).abs();
        let alike = group.iter().filter(|view| off(view) <= SAME_FOCAL).count();
        let others: Vec<usize> = group.iter().copied().filter(|view| off(view) > OTHER_FOCAL).collect();
        let few = others.len() as f64 <= FEW * group.len() as f64;
        if !others.is_empty() && few && alike as f64 >= (1.0 - 2.0 * FEW) * group.len() as f64 {
            told = told.or(Some((cameras[others[0]].focal_px.x, middle)));
            odd.extend(others.into_iter().map(|view| scene.views[view]));
        }
    }
    let (focal, middle) = told?;
    Some(
        Diagnostic::warning(format!(
            "{} of {} {} a focal length unlike the others of the same size: {:.1} px instead of {middle:.1} px ({:+.1} %) in \
             the first of {}; unless they were zoomed, correct their `fl_x` or drop them",
            odd.len(),
            count(scene.count(), "frame"),
            if odd.len() == 1 { "has" } else { "have" },
            focal,
            100.0 * (focal / middle - 1.0),
            scene.names(&odd)
        ))
        .about(odd),
    )
}

fn oblong_pixels(scene: &CameraSet<'_>) -> Option<Diagnostic> {
    let cameras: Vec<&Camera> = scene.cameras().collect();
    let ratio = |view: usize| cameras[view].focal_px.x / cameras[view].focal_px.y;
    let frames = scene.which(|view| (ratio(view) - 1.0).abs() > SQUARE);
    let first = (0..cameras.len()).find(|&view| (ratio(view) - 1.0).abs() > SQUARE)?;
    let camera = cameras[first];
    Some(
        Diagnostic::warning(format!(
            "pixels are not square in {}: the focal lengths are {:.1} px along x and {:.1} px along y, {:.1} % apart, with \
             {}x{} pixels, in {}; images that were stretched need no correction, otherwise check `fl_x`, `fl_y`, `w` and `h`",
            count(frames.len(), "frame"),
            camera.focal_px.x,
            camera.focal_px.y,
            100.0 * (ratio(first) - 1.0).abs(),
            camera.width,
            camera.height,
            scene.names(&frames)
        ))
        .about(frames),
    )
}

fn odd_fields_of_view(scene: &CameraSet<'_>) -> Option<Diagnostic> {
    let cameras: Vec<&Camera> = scene.cameras().collect();
    let is_odd = |view: usize| {
        let fov = fov_degrees(cameras[view]);
        is_flat(cameras[view])
            && (fov.max_element() > MOST_FOV_DEGREES || fov.max_element() < LEAST_FOV_DEGREES)
    };
    let first = (0..cameras.len()).find(|&view| is_odd(view))?;
    let frames = scene.which(is_odd);
    let fov = fov_degrees(cameras[first]);
    Some(
        Diagnostic::warning(format!(
            "the field of view is {:.1}° x {:.1}° in {}, outside of {LEAST_FOV_DEGREES}° to {MOST_FOV_DEGREES}°: the focal \
             length is {:.1} px with {}x{} pixels, in {}; check that `fl_x` and `w`, or the unit of `camera_angle_x` \
             (radians), are right",
            fov.x,
            fov.y,
            count(frames.len(), "frame"),
            cameras[first].focal_px.x,
            cameras[first].width,
            cameras[first].height,
            scene.names(&frames)
        ))
        .about(frames),
    )
}

fn far_off_centers(scene: &CameraSet<'_>) -> Option<Diagnostic> {
    let cameras: Vec<&Camera> = scene.cameras().collect();
    let is_far = |view: usize| center_off(cameras[view]).abs().max_element() > FAR_OFF;
    let first = (0..cameras.len()).find(|&view| is_far(view))?;
    let frames = scene.which(is_far);
    let camera = cameras[first];
    Some(
        Diagnostic::warning(format!(
            "the principal point is far off the middle in {}: at {:.0}, {:.0} of {}x{} pixels ({} to the side) in {}; unless \
             the images were cropped, check `cx` and `cy` against `w` and `h`",
            count(frames.len(), "frame"),
            camera.center_px.x,
            camera.center_px.y,
            camera.width,
            camera.height,
            percent(center_off(camera).abs().max_element()),
            scene.names(&frames)
        ))
        .about(frames),
    )
}
