//! Views all around a scene, from what the training cameras had in common.

use crate::camera::{Camera, Geometry, Lens};
use crate::support::statistics::median;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// A circle of upright cameras that look at the scene's centre.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Orbit {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Focal length in pixels.
    pub focal_px: f64,
    /// Whether the world is left-handed: its cameras are mirrored.
    pub left_handed: bool,
    /// Unit vector that points up, in world space.
    pub up: DVec3,
    /// Distance of the cameras from the centre, in world units.
    pub radius: f64,
    /// Angle of the cameras above the centre.
    pub elevation_rad: f64,
}

/// Steeper than this the direction that is up in the image would be ill-defined.
const STEEPEST_RAD: f64 = 1.3;
/// Half the field of view of an orbit around what very wide lenses saw.
const WIDEST_RAD: f64 = TAU / 12.0;

impl Orbit {
    /// The circle through the middle of `cameras`, whose scene lies around `center`.
    #[must_use]
    pub fn of(cameras: &[Camera], center: DVec3) -> Self {
        let up = up(cameras);
        let over = |value: &dyn Fn(&Camera) -> f64| median(cameras.iter().map(value)).unwrap_or(0.0);
        let elevation = |camera: &Camera| {
            let direction = (camera.position() - center).normalize_or_zero();
            direction.dot(up).clamp(-1.0, 1.0).asin()
        };
        let width = over(&|camera| f64::from(camera.width)).max(1.0);
        let tangent = over(&|camera| tangent(camera, center));
        let hand = over(&|camera| camera.world_from_camera.matrix3.determinant());
        Self {
            width: width as u32,
            height: over(&|camera| f64::from(camera.height)).max(1.0) as u32,
            focal_px: width / tangent.max(1e-6),
            left_handed: hand < 0.0,
            up,
            radius: over(&|camera| camera.position().distance(center)).max(1e-9),
            elevation_rad: over(&elevation).clamp(-STEEPEST_RAD, STEEPEST_RAD),
        }
    }

    /// `count` cameras around `center`, evenly spaced, without lens distortion.
    #[must_use]
    pub fn cameras(&self, center: DVec3, count: usize) -> Vec<Camera> {
        let size = DVec2::new(f64::from(self.width), f64::from(self.height));
        let (east, north) = self.up.any_orthonormal_pair();
        (0..count)
            .map(|index| {
                let (sin, cos) = (TAU * index as f64 / count as f64).sin_cos();
                let (lift, reach) = self.elevation_rad.sin_cos();
                let back = (reach * (cos * east + sin * north) + lift * self.up).normalize();
                let right = self.up.cross(back).normalize();
                let up = back.cross(right);
                let axes = DMat3::from_cols(if self.left_handed { -right } else { right }, up, back);
                Camera {
                    width: self.width,
                    height: self.height,
                    focal_px: DVec2::splat(self.focal_px),
                    center_px: 0.5 * size,
                    lens: Lens::Pinhole,
                    world_from_camera: DAffine3::from_mat3_translation(axes, center + self.radius * back),
                }
            })
            .collect()
    }
}

/// Width of a pinhole's view over the distance that shows what `camera` shows around `center`; 60 degrees where it
/// sees more than it is pointed at.
fn tangent(camera: &Camera, center: DVec3) -> f64 {
    let width = f64::from(camera.width) / camera.focal_px.x;
    match camera.lens.geometry() {
        Geometry::Plane => width,
        Geometry::Parallel => width / camera.position().distance(center).max(1e-9),
        Geometry::Angles => 2.0 * (0.5 * width).min(WIDEST_RAD).tan(),
    }
}

/// The direction across which the images' rows run least: photographers hold cameras level, but tilt them.
///
/// Power iteration on `1 - Σ r rᵀ / n` over the cameras' +X axes r, from the mean of their +Y axes; where the
/// rows leave the direction open, what is left of that mean remains.
fn up(cameras: &[Camera]) -> DVec3 {
    let axis =
        |column: fn(&DMat3) -> DVec3| cameras.iter().map(move |c| column(&c.world_from_camera.matrix3));
    let mean_up: DVec3 = axis(|axes| axes.y_axis).sum();
    let count = cameras.len().max(1) as f64;
    let start = mean_up.try_normalize().unwrap_or(DVec3::Z);
    let mut up = start;
    for _ in 0..200 {
        let rows: DVec3 = axis(|axes| axes.x_axis).map(|right| right * right.dot(up)).sum();
        up = (up - rows / count).try_normalize().unwrap_or(start);
    }
    if up.dot(start) < 0.0 { -up } else { up }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CENTER: DVec3 = DVec3::new(1.0, -2.0, 0.5);

    fn orbit(up: DVec3) -> Orbit {
        Orbit {
            width: 320,
            height: 200,
            focal_px: 300.0,
            left_handed: false,
            up: up.normalize(),
            radius: 3.0,
            elevation_rad: 0.4,
        }
    }

    #[test]
    fn an_orbit_is_found_again_from_part_of_its_cameras() {
        for up in [DVec3::Z, DVec3::Y, DVec3::new(0.3, -1.0, 0.2)] {
            let orbit = orbit(up);
            let found = Orbit::of(&orbit.cameras(CENTER, 24)[..7], CENTER);
            assert_eq!((found.width, found.height), (320, 200));
            assert!((found.focal_px - 300.0).abs() < 1e-9);
            assert!(found.up.distance(orbit.up) < 1e-6, "{} {}", found.up, orbit.up);
            assert!((found.radius - 3.0).abs() < 1e-9 && (found.elevation_rad - 0.4).abs() < 1e-6);
        }
    }

    #[test]
    fn cameras_see_the_centre_upright() {
        let orbit = orbit(DVec3::Z);
        for camera in orbit.cameras(CENTER, 5) {
            let (pixel, depth) = camera.project(CENTER).expect("in front");
            assert!(pixel.distance(DVec2::new(160.0, 100.0)) < 1e-9 && (depth - 3.0).abs() < 1e-9);
            let (above, _) = camera.project(CENTER + 0.1 * DVec3::Z).expect("in front");
            assert!((above.x - 160.0).abs() < 1e-9 && above.y < 100.0);
            assert!((camera.world_from_camera.matrix3.determinant() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn other_lenses_and_hands_become_a_similar_view() {
        let pinholes = orbit(DVec3::Z).cameras(CENTER, 9);
        let focal_px = |lens: Lens, focal_px: f64| {
            let cameras = pinholes.iter();
            let cameras: Vec<_> = cameras
                .map(|camera| Camera { lens, focal_px: DVec2::splat(focal_px), ..camera.clone() })
                .collect();
            Orbit::of(&cameras, CENTER).focal_px
        };
        // 100 pixels per unit at the distance of 3, and 300 per radian near the axis.
        assert!((focal_px(Lens::Orthographic, 100.0) - 300.0).abs() < 1e-6);
        assert!((focal_px(Lens::Fisheye { k: [0.0; 4] }, 306.0) - 277.6).abs() < 1.0);
        assert!((focal_px(Lens::Equirectangular, 320.0 / TAU) - 160.0 / WIDEST_RAD.tan()).abs() < 1e-6);
        let mirrored = Orbit { left_handed: true, ..orbit(DVec3::Z) };
        let cameras = mirrored.cameras(CENTER, 9);
        assert!(cameras.iter().all(|camera| camera.world_from_camera.matrix3.determinant() < -0.99));
        let found = Orbit::of(&cameras, CENTER);
        assert!(found.left_handed && found.up.distance(mirrored.up) < 1e-6);
        let (pixel, _) = cameras[0].project(CENTER + 0.1 * DVec3::Z).expect("in front");
        assert!((pixel.x - 160.0).abs() < 1e-9 && pixel.y < 100.0);
    }

    #[test]
    fn one_camera_gives_its_own_up() {
        let one = orbit(DVec3::Z).cameras(CENTER, 1);
        let found = Orbit::of(&one, CENTER);
        assert!(found.up.distance(one[0].world_from_camera.matrix3.y_axis) < 1e-9);
    }
}
