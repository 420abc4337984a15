//! Lenses: the ray that is imaged at a point, and the point where a direction is imaged.
//!
//! Points of the image are on the normalised image plane, `(pixel - center_px) / focal_px`, +x right and +y down;
//! the camera's axes are +X right, +Y up, the view along -Z. What the models mean is said at [`Lens`].

mod fisheye;
mod open_cv;

pub use fisheye::Fisheye;
pub use open_cv::{Distortion, TOLERANCE};

use crate::camera::Lens;
use glam::{DMat3, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

/// A ray in the camera's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensRay {
    /// Where it starts.
    pub start: DVec3,
    /// Unit direction.
    pub direction: DVec3,
}

/// The ray that is imaged at `plane`; `None` if there is none.
pub fn ray(lens: &Lens, plane: DVec2) -> Option<LensRay> {
    let through = |x: f64, y: f64| DVec3::new(x, -y, -1.0).normalize();
    let (start, direction) = match *lens {
        Lens::Pinhole => (DVec3::ZERO, through(plane.x, plane.y)),
        Lens::OpenCv { k, p } => {
            let ideal = Distortion { k, p }.undistort(plane)?;
            (DVec3::ZERO, through(ideal.x, ideal.y))
        }
        Lens::Fisheye { k } => {
            // The view axis turned to the right by θ, then around itself.
            let theta = Fisheye { k }.angle(plane.length())?;
            let around = DMat3::from_rotation_z(-plane.y.atan2(plane.x));
            (DVec3::ZERO, around * DMat3::from_rotation_y(-theta) * DVec3::NEG_Z)
        }
        Lens::Orthographic => (DVec3::new(plane.x, -plane.y, 0.0), DVec3::NEG_Z),
        Lens::Equirectangular => {
            if !(plane.x.abs() <= PI && plane.y.abs() <= FRAC_PI_2) {
                return None;
            }
            // The view axis turned up by the latitude, then to the right by the longitude.
            let turn = DMat3::from_rotation_y(-plane.x) * DMat3::from_rotation_x(-plane.y);
            (DVec3::ZERO, turn * DVec3::NEG_Z)
        }
    };
    Some(LensRay { start, direction })
}

/// Where a point of the camera's axes is imaged by a lens that sees it.
pub fn image(lens: &Lens, point: DVec3) -> DVec2 {
    let DVec3 { x: right, y: up, z: back } = point;
    let ideal = DVec2::new(right, -up) / -back;
    match *lens {
        Lens::Pinhole => ideal,
        Lens::OpenCv { k, p } => Distortion { k, p }.distort(ideal),
        Lens::Fisheye { k } => {
            let radius = Fisheye { k }.radius(angle(point, DVec3::NEG_Z));
            radius * DVec2::new(right, -up).normalize_or_zero()
        }
        Lens::Orthographic => DVec2::new(right, -up),
        Lens::Equirectangular => DVec2::new(right.atan2(-back), angle(point, DVec3::Y) - FRAC_PI_2),
    }
}

/// Where `is_below` turns from true to false, up to rounding.
fn bisect(mut low: f64, mut high: f64, is_below: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if is_below(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// The angle between a vector and a unit vector, as precise near 0 and π as anywhere (Kahan 2006).
fn angle(vector: DVec3, unit: DVec3) -> f64 {
    let vector = vector.normalize();
    2.0 * (vector - unit).length().atan2((vector + unit).length())
}

/// The depth of a point: along the ray for lenses that see sideways and behind, along the view axis for others.
pub fn depth(lens: &Lens, point: DVec3) -> f64 {
    match lens {
        Lens::Fisheye { .. } | Lens::Equirectangular => point.length(),
        Lens::Pinhole | Lens::OpenCv { .. } | Lens::Orthographic => -point.z,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use glam::{DAffine3, DQuat};

    /// The product's cameras do the same by other methods.
    #[test]
    fn cameras_agree() {
        let lenses = [
            Lens::Pinhole,
            Lens::OpenCv { k: [-0.28, 0.07, -0.004, 0.001], p: [0.002, -0.001] },
            Lens::OpenCv { k: [0.48, 0.9, 0.3, 0.1], p: [0.02, -0.01] },
            // Folds at 0.454 and unfolds at 0.449.
            Lens::OpenCv { k: [-0.9, 0.35, 0.0, 0.0], p: [5e-3, -8e-3] },
            Lens::Fisheye { k: [0.0; 4] },
            Lens::Fisheye { k: [-0.25, 0.02, 0.0, 0.0] },
            Lens::Fisheye { k: [-0.04, 0.01, -0.003, 0.0002] },
            Lens::Fisheye { k: [0.5, 0.3, 0.1, 0.05] },
            Lens::Orthographic,
            Lens::Equirectangular,
        ];
        for lens in lenses {
            let camera = Camera {
                width: 160,
                height: 120,
                focal_px: DVec2::new(40.0, 38.0),
                center_px: DVec2::new(75.0, 64.0),
                lens,
                world_from_camera: DAffine3::from_rotation_translation(
                    DQuat::from_rotation_x(0.4) * DQuat::from_rotation_y(2.0),
                    DVec3::new(1.0, 2.0, 3.0),
                ),
            };
            let mut with_rays = 0;
            for index in (0..160 * 120).step_by(7) {
                let pixel = DVec2::new(f64::from(index % 160) + 0.5, f64::from(index / 160) + 0.5);
                let (want, got) =
                    (ray(&lens, (pixel - camera.center_px) / camera.focal_px), camera.ray(pixel));
                assert_eq!(want.is_some(), got.is_some(), "{lens:?} {pixel}");
                let (Some(want), Some(got)) = (want, got) else { continue };
                with_rays += 1;
                let pose = camera.world_from_camera;
                let direction = pose.transform_vector3(want.direction);
                assert!(direction.distance(got.direction) < 1e-6, "{lens:?} {pixel}");
                assert!(pose.transform_point3(want.start).distance(got.origin) < 1e-12);
                let point = want.start + 3.0 * want.direction;
                let (back, along) = camera.project(pose.transform_point3(point)).expect("in view");
                let again = image(&lens, point) * camera.focal_px + camera.center_px;
                assert!(
                    back.distance(again) < 1e-6 && again.distance(pixel) < 1e-6,
                    "{lens:?} {pixel} {again}"
                );
                assert!((along - depth(&lens, point)).abs() < 1e-12);
            }
            assert!(with_rays > 100, "{lens:?}: {with_rays}");
        }
    }

    #[test]
    fn nothing_is_seen_off_the_sphere() {
        assert_eq!(ray(&Lens::Equirectangular, DVec2::new(3.2, 0.0)), None);
        assert_eq!(ray(&Lens::Equirectangular, DVec2::new(0.0, -1.6)), None);
        assert_eq!(ray(&Lens::Equirectangular, DVec2::NAN), None);
        assert_eq!(ray(&Lens::Fisheye { k: [0.0; 4] }, DVec2::new(0.0, 3.2)), None);
    }
}
