//! Longitude and latitude: the whole sphere around the camera in one image.

use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// The last pixel's edge may exceed the sphere by what rounding its focal length does.
const SLACK: f64 = 1.0 + 1e-9;

/// The unit direction at longitude `plane.x` and latitude `-plane.y`, in radians; `None` off the sphere.
pub(super) fn direction(plane: DVec2) -> Option<DVec3> {
    let on_sphere = plane.x.abs() <= PI * SLACK && plane.y.abs() <= FRAC_PI_2 * SLACK;
    let ((sin_longitude, cos_longitude), (sin_latitude, cos_latitude)) =
        (plane.x.sin_cos(), (-plane.y).sin_cos());
    on_sphere.then(|| DVec3::new(cos_latitude * sin_longitude, sin_latitude, -cos_latitude * cos_longitude))
}

/// Longitudes are stretched towards the poles. See [`super::Lens::stretch`].
pub(super) fn stretch(plane: DVec2, spread: f64) -> Option<f64> {
    let stretch = (plane.y.abs() + spread).cos().recip();
    let wraps = plane.x.abs() + spread * stretch >= PI;
    (plane.y.abs() + spread < FRAC_PI_2 && !wraps).then_some(stretch)
}

/// Where a point other than the origin is imaged.
pub(super) fn image(point: DVec3) -> DVec2 {
    DVec2::new(point.x.atan2(-point.z), -point.y.atan2(point.x.hypot(point.z)))
}
