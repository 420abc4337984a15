//! Focal lengths, in pixels or as fields of view.

use std::f64::consts::PI;

use anyhow::{Result, ensure};
use glam::DVec2;

use super::image_size::Measure;
use crate::capture::dataset::json::{Fields, REMEDY};
use crate::capture::dataset::notes::Notes;
use crate::capture::diagnostics::Severity;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Focal {
    Pixels(Measure),
    /// Tangent of half the field of view along x, y; at least one is known.
    HalfFov([Option<f64>; 2]),
}

/// Focal lengths along x and y in pixels; one that is missing is the other.
pub(super) fn pixels(fields: Fields) -> Result<Option<DVec2>> {
    for (x, y) in [("fl_x", "fl_y"), ("fx", "fy")] {
        let (fx, fy) = (fields.positive(x, 1e9)?, fields.positive(y, 1e9)?);
        if let Some(either) = fx.or(fy) {
            let least = fx.unwrap_or(either).min(fy.unwrap_or(either));
            ensure!(least > 1e-6, "`{x}` and `{y}` must be above 0.000001 pixels, found {least:e}; {REMEDY}");
            return Ok(Some(DVec2::new(fx.unwrap_or(either), fy.unwrap_or(either))));
        }
    }
    Ok(None)
}

/// Focal lengths in pixels at the size of an image.
pub(super) fn from_tangents([x, y]: [Option<f64>; 2], actual: DVec2) -> DVec2 {
    let x = x.map(|tangent| 0.5 * actual.x / tangent);
    let y = y.map(|tangent| 0.5 * actual.y / tangent);
    let either = x.or(y).unwrap_or(f64::NAN);
    DVec2::new(x.unwrap_or(either), y.unwrap_or(either))
}

/// Fields of view along x and y.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Angles(pub(super) [Option<Angle>; 2]);

/// A whole field of view and where it is written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Angle {
    pub(super) key: &'static str,
    pub(super) radians: f64,
}

impl Angle {
    pub(super) fn half_tangent(self) -> f64 {
        (0.5 * self.radians).tan()
    }
}

impl Angles {
    pub(super) fn read(fields: Fields, owner: &str, notes: &mut Notes) -> Result<Self> {
        for [x, y] in [["x_fov", "y_fov"], ["camera_angle_x", "camera_angle_y"], ["fovx", "fovy"]] {
            let angles = Self([angle(fields, x, owner, notes)?, angle(fields, y, owner, notes)?]);
            if angles.any() {
                return Ok(angles);
            }
        }
        Ok(Self::default())
    }

    pub(super) fn any(self) -> bool {
        self.0.iter().any(Option::is_some)
    }

    pub(super) fn half_tangents(self) -> [Option<f64>; 2] {
        self.0.map(|angle| angle.map(Angle::half_tangent))
    }
}

fn angle(fields: Fields, key: &'static str, owner: &str, notes: &mut Notes) -> Result<Option<Angle>> {
    let Some(stated) = fields.number(key)? else {
        return Ok(None);
    };
    let in_radians = key.starts_with("camera_angle");
    ensure!(
        stated > 1e-6 && stated < 180.0,
        "`{key}` must be above 0 and below {}, found {stated}; {REMEDY}",
        if in_radians { "pi, in radians" } else { "180, in degrees" }
    );
    let is_degrees = !in_radians || stated >= PI;
    if in_radians && is_degrees {
        let message =
            format!("`{key}` is {stated}, which cannot be radians; it is read as degrees, name it `x_fov`");
        notes.frame(Severity::Warning, owner, message);
    } else if key.starts_with("fov") && stated < PI {
        let message =
            format!("`{key}` is {stated} and read as degrees; if it is radians, name it `camera_angle_x`");
        notes.frame(Severity::Warning, owner, message);
    }
    Ok(Some(Angle { key, radians: if is_degrees { stated.to_radians() } else { stated } }))
}
