//! How the cameras of a path are rendered: their size, field of view and samples per pixel.

use crate::cli::Render;
use anyhow::{Context, Result};
use nerf::camera::Camera;
use nerf::field::checkpoint::Metadata;

/// Most samples along a side of a pixel that are taken unasked.
const MOST_STRATA: f64 = 4.0;

/// The camera at the size and with the field of view asked for; a side that is not given follows.
pub(super) fn framed(camera: Camera, args: &Render) -> Result<Camera> {
    let follow = |side: u32, other: u32, other_was: u32| {
        (f64::from(side) * f64::from(other) / f64::from(other_was)).round().max(1.0) as u32
    };
    let camera = match (args.width, args.height) {
        (None, None) => camera,
        (Some(width), Some(height)) => camera.reframed(width, height),
        (Some(width), None) => camera.reframed(width, follow(camera.height, width, camera.width)),
        (None, Some(height)) => camera.reframed(follow(camera.width, height, camera.height), height),
    };
    let Some(fov) = args.fov else { return Ok(camera) };
    let name = camera.lens.kind().name();
    camera.with_vertical_fov(fov.to_radians()).with_context(|| {
        format!(
            "--fov {fov} is no view of {} {name} camera: a plane shows less than 180 degrees, and parallel rays have no \
             angle; leave it out",
            if name.starts_with(['e', 'o', 'O']) { "an" } else { "a" }
        )
    })
}

/// Samples per pixel of a view of `camera`: as many as asked for, else so many that they lie as close as the pixels of the
/// training photos, which the field has details of.
pub(super) fn samples(camera: &Camera, metadata: &Metadata, args: &Render) -> u32 {
    args.spp.unwrap_or_else(|| {
        let orbit = &metadata.orbit;
        let trained = orbit.focal_px / orbit.radius;
        let strata = (trained / camera.pixels_per_length(orbit.radius)).round().clamp(1.0, MOST_STRATA);
        (strata * strata) as u32
    })
}
