//! Cells of the occupancy grid that can never hold anything: seen by no camera, or carved by silhouettes.
//!
//! Leaving them out from the start saves the first steps of a training run, which would otherwise fill the box
//! with fog and dissolve it again.

use super::Space;
use super::silhouette::Silhouette;
use crate::camera::{Camera, Geometry};
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};

/// Views that must agree that a cell is empty: one wrong mask or pose must not cut a hole.
const VIEWS_TO_CARVE: usize = 2;

/// Pixels added around a cell's footprint, for filtered edges and inexact poses.
const MARGIN_PX: f64 = 1.5;

/// What one view says of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sight {
    /// Out of view.
    Unseen,
    /// In view, in front of something that may be opaque.
    Seen,
    /// In view, and everything there is transparent.
    Empty,
}

/// `true` for each cell (of `cells`³ per cascade, inner cascade first, x fastest) that no camera sees or that
/// the alpha of several images shows to be empty.
#[must_use]
pub fn hidden_cells(cameras: &[Camera], silhouettes: &[Silhouette], space: &Space, cells: u32) -> Vec<bool> {
    let views: Vec<_> = cameras
        .iter()
        .zip(silhouettes)
        .map(|(camera, silhouette)| CameraCone::new(camera, silhouette))
        .collect();
    let carves = views.iter().any(|view| !view.silhouette.is_opaque());
    let count: usize = space.grid_shape(cells).iter().product();
    (0..count as u32)
        .into_par_iter()
        .map(|index| {
            let (center, side) = space.cell(index, cells);
            is_hidden(&views, carves, center, side)
        })
        .collect()
}

fn is_hidden(views: &[CameraCone<'_>], carves: bool, center: DVec3, side: f64) -> bool {
    let radius = side * 3f64.sqrt() / 2.0;
    let mut seen = false;
    let mut empty = 0;
    for view in views {
        match view.sight(center, radius) {
            Sight::Unseen => {}
            Sight::Seen if !carves => return false,
            Sight::Seen => seen = true,
            Sight::Empty => {
                empty += 1;
                if empty >= VIEWS_TO_CARVE {
                    return true;
                }
            }
        }
    }
    !seen && empty == 0
}

struct CameraCone<'a> {
    camera: &'a Camera,
    /// Largest angle of a pixel's ray to the view axis, in radians: what lies outside this cone need not be
    /// projected. π where the rays form no cone.
    half_angle: f64,
    silhouette: &'a Silhouette,
}

impl<'a> CameraCone<'a> {
    fn new(camera: &'a Camera, silhouette: &'a Silhouette) -> Self {
        Self { camera, half_angle: half_angle(camera), silhouette }
    }

    /// What this view says of a ball.
    fn sight(&self, center: DVec3, radius: f64) -> Sight {
        let camera = self.camera;
        let toward = center - camera.position();
        let distance = toward.length();
        if distance < radius {
            return Sight::Seen;
        }
        if toward.angle_between(camera.forward()) > self.half_angle + (radius / distance).asin() {
            return Sight::Unseen;
        }
        let is_behind = toward.dot(camera.forward()) <= -radius;
        if is_behind && !camera.lens.depth_is_distance() {
            return Sight::Unseen;
        }
        // Where it is not known what a lens makes of the ball, it may be seen.
        let Some((pixel, reach)) = camera.footprint(center, radius) else { return Sight::Seen };
        let reach = reach + MARGIN_PX;
        let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
        let (low, high) = (pixel - reach, pixel + reach);
        if high.cmplt(DVec2::ZERO).any() || low.cmpgt(size).any() {
            return Sight::Unseen;
        }
        let inside = low.cmpge(DVec2::ZERO).all() && high.cmple(size).all();
        if inside && self.silhouette.is_empty_within(low, high) {
            return Sight::Empty;
        }
        Sight::Seen
    }
}

/// The corners and the middles of the sides are farthest from the axis.
fn half_angle(camera: &Camera) -> f64 {
    // Beyond its rim a lens sees nothing, so that it is the cone where the image reaches farther.
    let rim = match (camera.lens.geometry(), camera.lens.rim()) {
        (Geometry::Parallel, _) | (Geometry::Angles, None) => return PI,
        (Geometry::Plane, rim) => rim.map_or(FRAC_PI_2, f64::atan),
        (Geometry::Angles, Some(rim)) => rim,
    };
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let forward = camera.forward();
    let sides =
        [0.0, 0.5, 1.0].into_iter().flat_map(|x| [0.0, 0.5, 1.0].map(|y| DVec2::new(x * width, y * height)));
    let margin = MARGIN_PX / camera.focal_px.min_element();
    let angle = |pixel| camera.ray(pixel).map_or(rim, |ray| ray.direction.angle_between(forward));
    sides.map(angle).fold(0.0, f64::max) + margin
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Bounds, Lens};
    use crate::photo::{Image, Pixels};
    use glam::{DAffine3, DMat3};

    const SIZE: u32 = 64;

    fn camera(lens: Lens) -> Camera {
        let focal_px = match lens {
            Lens::Orthographic => 24.0,
            // 100 degrees to the left, and half of the sphere.
            Lens::Fisheye { .. } => 18.3,
            Lens::Equirectangular => 12.0,
            Lens::Pinhole | Lens::OpenCv { .. } => 40.0,
        };
        let back = DVec3::new(0.3, -1.0, 0.4).normalize();
        let right = DVec3::Z.cross(back).normalize();
        Camera {
            width: SIZE,
            height: SIZE,
            focal_px: DVec2::splat(focal_px),
            center_px: DVec2::new(30.0, 33.0),
            lens,
            world_from_camera: DAffine3::from_mat3_translation(
                DMat3::from_cols(right, back.cross(right), back),
                DVec3::new(0.1, -0.4, 0.2),
            ),
        }
    }

    /// No cell that a pixel's ray goes through before it meets anything opaque may be taken for hidden.
    #[test]
    fn cells_on_rays_are_seen_through_every_lens() {
        let bounds =
            Bounds { center: DVec3::ZERO, half: 1.0, cascades: 1, source: String::new(), is_guess: false };
        let space = Space::from(&bounds);
        let cells = 16;
        for lens in [
            Lens::Pinhole,
            Lens::OpenCv { k: [-0.45, 0.05, 0.0, 0.0], p: [1e-3, 2e-3] },
            Lens::Fisheye { k: [0.0; 4] },
            Lens::Fisheye { k: [-0.1, 0.0, 0.0, 0.0] },
            Lens::Fisheye { k: [0.1, 0.05, 0.0, 0.0] },
            Lens::Orthographic,
            Lens::Equirectangular,
        ] {
            let camera = camera(lens);
            let opaque = |x: u32, y: u32| (x / 32 + y / 32).is_multiple_of(2);
            let pixels = (0..SIZE * SIZE).map(|i| [255 * u8::from(opaque(i % SIZE, i / SIZE)); 4]).collect();
            let image = Image { width: SIZE, height: SIZE, has_alpha: true, pixels: Pixels::Srgb8(pixels) };
            let views = [camera.clone(), camera.clone(), camera.clone()];
            let silhouette = Silhouette::of(&image.into());
            let silhouettes = [silhouette.clone(), silhouette.clone(), silhouette];
            let hidden = hidden_cells(&views, &silhouettes, &space, cells);
            for index in (0..SIZE * SIZE).filter(|i| opaque(i % SIZE, i / SIZE)) {
                let pixel = DVec2::new(f64::from(index % SIZE) + 0.5, f64::from(index / SIZE) + 0.5);
                let Some(ray) = camera.ray(pixel) else { continue };
                for step in 1..60 {
                    let at = ray.origin + ray.direction * 0.05 * f64::from(step);
                    let cell = ((at + 1.0) * 0.5 * f64::from(cells)).floor();
                    if cell.min_element() < 0.0 || cell.max_element() >= f64::from(cells) {
                        break;
                    }
                    let [x, y, z] = cell.to_array().map(|c| c as usize);
                    let n = cells as usize;
                    assert!(!hidden[x + n * (y + n * z)], "{lens:?}: {pixel} sees {at}");
                }
            }
            let count = hidden.iter().filter(|&&hidden| hidden).count();
            assert!(count > 100, "{lens:?} hides {count} cells");
        }
    }
}
