//! How much of the scene box the cameras see, from a grid of rays through every picture.

use super::{CameraSet, Diagnostic, Spread};
use crate::camera::Bounds;
use crate::camera::Camera;
use crate::support::format::{count, percent};
use glam::{DVec2, dvec2};
use rayon::prelude::*;

/// Rays along either side of a picture.
const SIDE: u32 = 16;
/// A lens that has no ray for more of its picture than this is a mistake: circular fisheyes leave out a fifth.
const MOST_WITHOUT_RAY: f64 = 0.3;

/// What part of each picture shows the scene box.
#[derive(Clone, Debug)]
pub struct Coverage {
    /// One per view.
    pub pictures: Vec<PictureShares>,
    /// Indices of the frames that see least of the whole box, worst first.
    pub worst: Vec<usize>,
}

/// What part of a picture shows the scene box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureShares {
    /// The part whose rays meet the whole box.
    pub outer: f64,
    /// The part whose rays meet the inner cube.
    pub inner: f64,
    /// The part that the lens has no rays for.
    pub rayless: f64,
}

impl Coverage {
    pub(super) fn of(scene: &CameraSet<'_>) -> Self {
        let cameras: Vec<&Camera> = scene.cameras().collect();
        let bounds = &scene.dataset.bounds;
        let pictures: Vec<_> = cameras.par_iter().map(|camera| picture(camera, bounds)).collect();
        let mut order: Vec<usize> = (0..pictures.len()).collect();
        order.sort_by(|&a, &b| {
            let parts = |view: usize| [pictures[view].outer, pictures[view].inner];
            parts(a).partial_cmp(&parts(b)).unwrap_or(std::cmp::Ordering::Equal)
        });
        let worst = order.iter().take(3).map(|&view| scene.views[view]).collect();
        Self { pictures, worst }
    }

    /// The parts of the pictures that show the whole box.
    #[must_use]
    pub fn outer(&self) -> Spread {
        Spread::of(self.pictures.iter().map(|picture| picture.outer))
    }

    /// The parts of the pictures that show the inner cube.
    #[must_use]
    pub fn inner(&self) -> Spread {
        Spread::of(self.pictures.iter().map(|picture| picture.inner))
    }

    pub(super) fn findings(&self, scene: &CameraSet<'_>) -> Vec<Diagnostic> {
        let mut findings = Vec::new();
        let blind = scene.which(|view| self.pictures[view].outer == 0.0);
        if blind.len() == scene.count() {
            findings.push(Diagnostic::error(
                "no camera sees any of the scene box, so there is nothing to train on; check the poses, or write \
                 `aabb`: [[x, y, z], [x, y, z]], the corners of what to show, into the file",
            ));
        } else if !blind.is_empty() {
            let trained = blind.iter().filter(|index| scene.dataset.train.contains(index)).count();
            let consequence = match trained {
                0 => "though their photos are to be measured".to_owned(),
                all if all == blind.len() => "and are trained on for nothing".to_owned(),
                some => format!("and {some} of them are trained on for nothing"),
            };
            findings.push(
                Diagnostic::warning(format!(
                    "{} of {} see nothing of the scene box, {consequence}: {}; check their poses, or write a larger box \
                     (`aabb`, `aabb_scale`) into the file",
                    blind.len(),
                    count(scene.count(), "camera"),
                    scene.names(&blind)
                ))
                .about(blind),
            );
        }
        let rayless = scene.which(|view| self.pictures[view].rayless > MOST_WITHOUT_RAY);
        if !rayless.is_empty() {
            let worst = self.pictures.iter().map(|picture| picture.rayless).fold(0.0, f64::max);
            findings.push(
                Diagnostic::warning(format!(
                    "the lens model has no ray for up to {} of the picture in {}: {}; check the distortion \
                     coefficients and `camera_model`",
                    percent(worst),
                    count(rayless.len(), "frame"),
                    scene.names(&rayless)
                ))
                .about(rayless),
            );
        }
        findings
    }
}

fn picture(camera: &Camera, bounds: &Bounds) -> PictureShares {
    let size = dvec2(f64::from(camera.width), f64::from(camera.height));
    let (mut outer, mut inner, mut rayless) = (0, 0, 0);
    for index in 0..SIDE * SIDE {
        let cell = dvec2(f64::from(index % SIDE), f64::from(index / SIDE)) + DVec2::splat(0.5);
        match camera.ray(cell / f64::from(SIDE) * size) {
            Some(ray) => {
                outer += u32::from(bounds.meets(bounds.outer_half(), &ray));
                inner += u32::from(bounds.meets(bounds.half, &ray));
            }
            None => rayless += 1,
        }
    }
    let part = |rays: u32| f64::from(rays) / f64::from(SIDE * SIDE);
    PictureShares { outer: part(outer), inner: part(inner), rayless: part(rayless) }
}
