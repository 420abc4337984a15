//! Other sizes and fields of view of a lens. Pixels keep their shape, so that a ball stays round.

use super::{Camera, Geometry};
use glam::DVec2;
use std::f64::consts::PI;

impl Camera {
    /// The view at another image size in pixels: it scales with the height, so that the vertical field of view stays, and
    /// shows more or less on the left and on the right.
    pub fn reframed(&self, width: u32, height: u32) -> Self {
        let scale = f64::from(height) / f64::from(self.height);
        let middle = |width: u32, height: u32| 0.5 * DVec2::new(f64::from(width), f64::from(height));
        let off_center = self.center_px - middle(self.width, self.height);
        let center_px = middle(width, height) + scale * off_center;
        Self { width, height, focal_px: scale * self.focal_px, center_px, ..*self }
    }

    /// The view with another vertical field of view, in radians, as it were without distortion and with the principal
    /// point in the middle; `None` where the lens has no such view: parallel rays have no angle, and a plane shows less
    /// than half of the sphere.
    pub fn with_vertical_fov(&self, fov_rad: f64) -> Option<Self> {
        let half_height = 0.5 * f64::from(self.height);
        let focal = match self.lens.geometry() {
            Geometry::Plane if fov_rad < PI => half_height / (0.5 * fov_rad).tan(),
            Geometry::Angles => half_height / (0.5 * fov_rad),
            _ => return None,
        };
        Some(Self { focal_px: self.focal_px * (focal / self.focal_px.y), ..*self })
    }

    /// The view whose pixels' centres see what was seen `offset` pixels to the right and below of them.
    pub fn shifted(&self, offset: DVec2) -> Self {
        Self { center_px: self.center_px - offset, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Lens;
    use glam::{DAffine3, DVec3};
    use std::f64::consts::{FRAC_PI_2, TAU};

    fn camera(lens: Lens) -> Camera {
        let sphere = lens == Lens::Equirectangular;
        Camera {
            width: 200,
            height: 100,
            focal_px: if sphere { DVec2::splat(200.0 / TAU) } else { DVec2::new(90.0, 90.0) },
            center_px: if sphere { DVec2::new(100.0, 50.0) } else { DVec2::new(104.0, 47.0) },
            lens,
            world_from_camera: DAffine3::IDENTITY,
        }
    }

    #[test]
    fn another_aspect_keeps_the_vertical_view_and_the_shape_of_pixels() {
        let open_cv = Lens::OpenCv { k: [0.02, 0.0, 0.0, 0.0], p: [0.0; 2] };
        for lens in [Lens::Pinhole, open_cv, Lens::Fisheye { k: [0.0; 4] }, Lens::Orthographic] {
            let whole = camera(lens);
            for (width, height) in [(200, 200), (80, 50), (600, 100), (400, 200)] {
                let part = whole.reframed(width, height);
                assert_eq!((part.width, part.height), (width, height));
                assert_eq!(part.focal_px.x, part.focal_px.y, "{lens:?}");
                // The middle column, at the top and at the bottom.
                let scale = f64::from(height) / 100.0;
                for y in [0.5, 99.5] {
                    let (before, now) = (
                        whole.ray(DVec2::new(100.0, y)).expect("seen"),
                        part.ray(DVec2::new(0.5 * f64::from(width), y * scale)).expect("seen"),
                    );
                    assert!(before.direction.distance(now.direction) < 1e-14, "{lens:?}");
                    assert!(before.origin.distance(now.origin) < 1e-14, "{lens:?}");
                }
            }
        }
        let panorama = camera(Lens::Equirectangular).reframed(100, 100);
        let at = |x: f64| panorama.ray(DVec2::new(x, 50.0)).expect("on the sphere").direction;
        assert!(at(0.0).distance(DVec3::NEG_X) < 1e-14 && at(100.0).distance(DVec3::X) < 1e-14);
    }

    #[test]
    fn a_field_of_view_is_vertical() {
        let top = |lens, fov: f64| {
            let camera =
                Camera { center_px: DVec2::new(100.0, 50.0), ..camera(lens) }.with_vertical_fov(fov)?;
            Some(camera.ray(DVec2::new(100.0, 0.0))?.direction.y.asin())
        };
        let is = |found: Option<f64>, fov: f64| found.is_some_and(|angle| (angle - 0.5 * fov).abs() < 1e-12);
        assert!(is(top(Lens::Pinhole, FRAC_PI_2), FRAC_PI_2));
        assert!(is(top(Lens::Fisheye { k: [0.0; 4] }, 2.5), 2.5));
        assert!(is(top(Lens::Equirectangular, 1.0), 1.0));
        assert_eq!((top(Lens::Pinhole, PI), top(Lens::Orthographic, 1.0)), (None, None));
    }
}
