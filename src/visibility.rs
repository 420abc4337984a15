//! Cells of the occupancy grid that can never hold anything: seen by no camera, or carved by silhouettes.
//!
//! Leaving them out from the start saves the first steps of a training, which would otherwise fill the box
//! with fog and dissolve it again.

use crate::camera::Camera;
use crate::dataset::Bounds;
use crate::image::{Image, Pixels};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

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
pub fn hidden_cells(cameras: &[Camera], images: &[Image], bounds: &Bounds, cells: u32) -> Vec<bool> {
    let views: Vec<View<'_>> =
        cameras.iter().zip(images).map(|(camera, image)| View::new(camera, image)).collect();
    let carves = views.iter().any(|view| !view.opaque_sums.is_empty());
    let per_cascade = cells.pow(3);
    (0..per_cascade * bounds.cascades)
        .into_par_iter()
        .map(|index| {
            let side = 2.0 * bounds.half * f64::from(1u32 << (index / per_cascade)) / f64::from(cells);
            let within = index % per_cascade;
            let corner = DVec3::new(
                f64::from(within % cells),
                f64::from(within / cells % cells),
                f64::from(within / (cells * cells)),
            );
            let center = bounds.center + (corner + 0.5 - f64::from(cells) / 2.0) * side;
            is_hidden(&views, carves, center, side)
        })
        .collect()
}

fn is_hidden(views: &[View<'_>], carves: bool, center: DVec3, side: f64) -> bool {
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

struct View<'a> {
    camera: &'a Camera,
    /// Largest angle of a pixel's ray to the view axis, in radians: what lies outside this cone need not be
    /// projected.
    half_angle: f64,
    /// Number of pixels with any alpha in the rectangle from the corner to here, `(width + 1) × (height + 1)`;
    /// empty for an opaque image.
    opaque_sums: Vec<u32>,
}

impl<'a> View<'a> {
    fn new(camera: &'a Camera, image: &Image) -> Self {
        let opaque_sums = if image.has_alpha { opaque_sums(image) } else { Vec::new() };
        Self { camera, half_angle: half_angle(camera), opaque_sums }
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
        let Some((pixel, depth)) = camera.project(center) else { return Sight::Unseen };
        if depth <= 0.0 {
            return Sight::Unseen;
        }
        let reach = radius / depth * camera.focal_px.max_element() + MARGIN_PX;
        let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
        let (low, high) = (pixel - reach, pixel + reach);
        if high.cmplt(DVec2::ZERO).any() || low.cmpgt(size).any() {
            return Sight::Unseen;
        }
        let inside = low.cmpge(DVec2::ZERO).all() && high.cmple(size).all();
        if inside && !self.opaque_sums.is_empty() && self.count_opaque(low, high) == 0 {
            return Sight::Empty;
        }
        Sight::Seen
    }

    fn count_opaque(&self, low: DVec2, high: DVec2) -> u32 {
        let stride = self.camera.width as usize + 1;
        let at = |x: f64, y: f64| self.opaque_sums[y as usize * stride + x as usize];
        let (low, high) = (low.floor(), high.ceil());
        (at(high.x, high.y) + at(low.x, low.y)) - at(low.x, high.y) - at(high.x, low.y)
    }
}

/// The corners and the middles of the sides are farthest from the axis.
fn half_angle(camera: &Camera) -> f64 {
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let forward = camera.forward();
    let rim =
        [0.0, 0.5, 1.0].into_iter().flat_map(|x| [0.0, 0.5, 1.0].map(|y| DVec2::new(x * width, y * height)));
    let margin = MARGIN_PX / camera.focal_px.min_element();
    let angle = |pixel| camera.ray(pixel).map(|ray| ray.direction.angle_between(forward));
    // A lens without a ray there sees the whole half space.
    rim.map(angle)
        .try_fold(0.0, |most: f64, angle| angle.map(|angle| most.max(angle)))
        .map_or(std::f64::consts::FRAC_PI_2, |most| most + margin)
}

fn opaque_sums(image: &Image) -> Vec<u32> {
    let (width, height) = (image.width as usize, image.height as usize);
    let is_opaque = |index: usize| match &image.pixels {
        Pixels::Srgb8(pixels) => pixels[index][3] > 0,
        Pixels::Srgb16(pixels) => pixels[index][3] > 0,
        Pixels::Linear(pixels) => pixels[index][3] > 0.0,
    };
    let mut sums = vec![0; (width + 1) * (height + 1)];
    for y in 0..height {
        let mut row = 0;
        for x in 0..width {
            row += u32::from(is_opaque(y * width + x));
            sums[(y + 1) * (width + 1) + x + 1] = sums[y * (width + 1) + x + 1] + row;
        }
    }
    sums
}
