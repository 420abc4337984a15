//! Cameras: pose, intrinsics and lens, from a pixel to a ray in the dataset's world space.
//!
//! Camera axes are OpenGL's: +X right, +Y up, the camera looks along -Z. Pixel space has its origin at
//! the top-left corner of the image, +x right and +y down; the centre of pixel `(i, j)` is
//! `(i + 0.5, j + 0.5)`.

mod bounds;
mod branch;
mod equirectangular;
mod fisheye;
mod framing;
mod lens;
mod open_cv;
pub mod orbit;

pub use bounds::Bounds;
pub use lens::{Geometry, Lens, LensKind};

use glam::{DAffine3, DVec2, DVec3};
use lens::LensRay;
use serde::{Deserialize, Serialize};

/// One camera. Lengths are in world units, image quantities in pixels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Focal lengths along x and y, in pixels; what they mean for a lens without focus is said at [`Lens`].
    pub focal_px: DVec2,
    /// Principal point, in pixels from the top-left corner.
    pub center_px: DVec2,
    /// How directions are mapped to the image.
    pub lens: Lens,
    /// Camera-to-world pose: an orthonormal matrix and a translation. The matrix is improper (determinant -1)
    /// where the dataset's world is left-handed.
    pub world_from_camera: DAffine3,
}

/// A ray in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where the ray starts: the camera's position, or for parallel rays a point of the image plane.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
}

impl Camera {
    /// The world-space ray through a point of the image (pixel space), or `None` where the lens maps
    /// no direction to that point (beyond its rim, or off the sphere).
    pub fn ray(&self, pixel: DVec2) -> Option<Ray> {
        let LensRay { offset, direction } = self.lens.ray((pixel - self.center_px) / self.focal_px)?;
        let pose = self.world_from_camera;
        Some(Ray {
            origin: pose.transform_point3(offset),
            direction: pose.transform_vector3(direction).normalize(),
        })
    }

    /// Where a world-space point appears in pixel space, and its depth in world units, along the view axis or
    /// along the ray as [`Lens::depth_is_distance`] says; `None` where the lens does not see the point: behind
    /// the camera, beyond the rim. The point may lie outside the image.
    pub fn project(&self, world: DVec3) -> Option<(DVec2, f64)> {
        let (plane, depth) = self.lens.image(self.world_from_camera.inverse().transform_point3(world))?;
        Some((plane * self.focal_px + self.center_px, depth))
    }

    /// The world-space point at a depth, in world units, behind a point of the image: [`Camera::project`] backwards.
    pub fn point(&self, pixel: DVec2, depth: f64) -> Option<DVec3> {
        let ray = self.ray(pixel)?;
        Some(ray.origin + ray.direction * (depth / self.depth_of_unit(ray.direction)))
    }

    /// The depth that one world unit along a unit direction is worth.
    pub fn depth_of_unit(&self, direction: DVec3) -> f64 {
        if self.lens.depth_is_distance() { 1.0 } else { direction.dot(self.forward()) }
    }

    /// Whether a world-space point appears within the image, were nothing in between.
    pub fn has_in_picture(&self, world: DVec3) -> bool {
        let size = DVec2::new(f64::from(self.width), f64::from(self.height));
        self.project(world).is_some_and(|(at, _)| at.cmpge(DVec2::ZERO).all() && at.cmple(size).all())
    }

    /// How many pixels a world unit across the view covers at `distance` from the camera, near the view axis.
    pub fn pixels_per_length(&self, distance: f64) -> f64 {
        let focal_px = self.focal_px.max_element();
        if self.lens.geometry() == Geometry::Parallel { focal_px } else { focal_px / distance }
    }

    /// Where a ball is imaged: a point of pixel space, and a distance from it in pixels that holds the whole image.
    /// `None` where there is no such disc, or none that is worth computing: at the rim of a lens, where an image
    /// wraps around, and around the camera. For pinholes the distance is that of a ball on the axis.
    pub fn footprint(&self, center: DVec3, radius: f64) -> Option<(DVec2, f64)> {
        let seen = self.world_from_camera.inverse().transform_point3(center);
        let (plane, depth) = self.lens.image(seen)?;
        let reach = match self.lens.geometry() {
            Geometry::Plane => radius / depth,
            Geometry::Parallel => radius,
            Geometry::Angles => {
                let spread = (radius / depth).asin();
                self.lens.stretch(plane, seen, spread)? * spread
            }
        };
        Some((plane * self.focal_px + self.center_px, reach * self.focal_px.max_element()))
    }

    /// Unit view direction in world space.
    pub fn forward(&self) -> DVec3 {
        -self.world_from_camera.matrix3.z_axis
    }

    /// Centre of projection in world space; for parallel rays the principal point on the image plane.
    pub fn position(&self) -> DVec3 {
        self.world_from_camera.translation
    }

    /// The part of the view inside a window of `size` pixels, whose top-left corner is at `corner`, in pixels.
    pub fn cropped(&self, corner: [u32; 2], size: [u32; 2]) -> Self {
        let [left, top] = corner.map(f64::from);
        let [width, height] = size;
        Self { width, height, center_px: self.center_px - DVec2::new(left, top), ..*self }
    }

    /// The same view at another image size in pixels; the intrinsics scale along.
    pub fn resized(&self, width: u32, height: u32) -> Self {
        let scale =
            DVec2::new(f64::from(width) / f64::from(self.width), f64::from(height) / f64::from(self.height));
        Self { width, height, focal_px: self.focal_px * scale, center_px: self.center_px * scale, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    fn camera(lens: Lens) -> Camera {
        let (width, height) = (1080, 1920);
        let focal = match lens.kind() {
            LensKind::Pinhole | LensKind::OpenCv => DVec2::new(1375.5, 1371.2),
            // The corners lie 100 degrees off the axis where θ_d = θ.
            LensKind::Fisheye => DVec2::splat(1101.5 / 100f64.to_radians()),
            LensKind::Orthographic => DVec2::new(402.0, 395.0),
            LensKind::Equirectangular => DVec2::new(f64::from(width) / TAU, f64::from(height) / PI),
        };
        let half = DVec2::new(0.5 * f64::from(width), 0.5 * f64::from(height));
        let is_whole_sphere = lens == Lens::Equirectangular;
        Camera {
            width,
            height,
            focal_px: focal,
            center_px: if is_whole_sphere { half } else { DVec2::new(554.6, 965.3) },
            lens,
            world_from_camera: DAffine3::from_rotation_translation(
                DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.3),
                DVec3::new(3.0, -2.0, 0.5),
            ),
        }
    }

    /// With the share of the image in which they have rays.
    fn lenses() -> Vec<(Lens, f64)> {
        let open_cv = |k, p| (Lens::OpenCv { k, p }, 1.0);
        vec![
            (Lens::Pinhole, 1.0),
            open_cv([0.0578, -0.0805, 0.0, 0.0], [-9.8e-4, 1.6e-4]),
            open_cv([-0.35, 0.15, -0.03, 0.0], [0.003, -0.002]),
            open_cv([0.48, 0.9, 0.3, 0.1], [0.02, -0.01]),
            open_cv([-0.15, 0.0, 0.0, 0.0], [0.0, 0.0]),
            (Lens::OpenCv { k: [-0.45, 0.05, 0.0, 0.0], p: [1e-3, 2e-3] }, 0.8),
            (Lens::Fisheye { k: [0.0; 4] }, 1.0),
            (Lens::Fisheye { k: [-0.02, 0.003, -0.0006, 0.00001] }, 1.0),
            (Lens::Fisheye { k: [0.4, 0.2, 0.1, 0.05] }, 1.0),
            (Lens::Fisheye { k: [-0.25, 0.02, 0.0, 0.0] }, 0.5),
            (Lens::Orthographic, 1.0),
            (Lens::Equirectangular, 1.0),
        ]
    }

    /// Every third pixel of both axes in full size, and all pixels of the first and last rows.
    fn pixels(camera: &Camera) -> impl Iterator<Item = DVec2> {
        let (width, height) = (camera.width, camera.height);
        let rows = (0..height).filter(move |y| y % 3 == 0 || *y == height - 1);
        let all = rows.flat_map(move |y| (0..width).map(move |x| (x, y)));
        all.filter(move |(x, y)| x % 3 == 0 || *y == 0 || *y == height - 1 || *x == width - 1)
            .map(|(x, y)| DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5))
    }

    #[test]
    fn a_ray_projects_back_onto_its_pixel() {
        // A left-handed world mirrors the rays along with its points.
        for ((lens, share), hand) in lenses().into_iter().zip([1.0, -1.0].into_iter().cycle()) {
            let mut camera = camera(lens);
            camera.world_from_camera.matrix3.y_axis *= hand;
            let (mut count, mut seen) = (0, 0);
            for pixel in pixels(&camera) {
                count += 1;
                let Some(ray) = camera.ray(pixel) else { continue };
                seen += 1;
                assert!((ray.direction.length() - 1.0).abs() < 1e-14);
                let (back, depth) = camera.project(ray.origin + 7.0 * ray.direction).expect("in front");
                assert!(back.distance(pixel) < 1e-6, "{lens:?} {pixel} -> {back}");
                let along = if lens.depth_is_distance() { 1.0 } else { ray.direction.dot(camera.forward()) };
                assert!((depth - 7.0 * along).abs() < 1e-12, "{lens:?} {depth}");
                let point = camera.point(pixel, depth).expect("the same ray");
                assert!(point.distance(ray.origin + 7.0 * ray.direction) < 1e-11, "{lens:?} {point}");
                assert!(camera.has_in_picture(point), "{lens:?} {pixel}");
            }
            let found = f64::from(seen) / f64::from(count);
            assert!(found <= share && found > share - 0.2, "{lens:?}: {found} of the pixels have rays");
        }
    }

    #[test]
    fn beyond_the_rim_of_a_lens_there_is_no_ray() {
        // r (1 - 0.4 r²) peaks at r = 0.9129 with the value 0.6086.
        let camera = camera(Lens::OpenCv { k: [-0.4, 0.0, 0.0, 0.0], p: [0.0; 2] });
        let seen =
            |camera: &Camera, plane: DVec2| camera.ray(camera.center_px + plane * camera.focal_px).is_some();
        assert!(seen(&camera, DVec2::new(0.608, 0.0)) && !seen(&camera, DVec2::new(0.609, 0.0)));
        let project = |camera: &Camera, x: f64, y: f64, z: f64| {
            camera.project(camera.world_from_camera.transform_point3(DVec3::new(x, y, z)))
        };
        assert_eq!(project(&camera, 1.3, 0.0, -1.0), None);
        // θ (1 - 0.1 θ²) peaks at θ = 1.8257 with the value 1.2172.
        let fisheye = super::tests::camera(Lens::Fisheye { k: [-0.1, 0.0, 0.0, 0.0] });
        assert!(seen(&fisheye, DVec2::new(0.0, 1.217)) && !seen(&fisheye, DVec2::new(0.0, 1.218)));
        let at = |theta: f64| project(&fisheye, -theta.sin(), 0.0, -theta.cos());
        assert!(at(1.82).is_some() && at(1.83).is_none());
        // Without distortion, straight back is the last circle.
        let round = super::tests::camera(Lens::Fisheye { k: [0.0; 4] });
        assert!(seen(&round, DVec2::new(-3.13, 0.0)) && !seen(&round, DVec2::new(-3.15, 0.0)));
        let sphere = super::tests::camera(Lens::Equirectangular);
        assert!(seen(&sphere, DVec2::new(3.13, -1.56)));
        assert!(!seen(&sphere, DVec2::new(3.15, 0.0)) && !seen(&sphere, DVec2::new(0.0, 1.58)));
        for lens in [camera.clone(), fisheye, round, sphere] {
            assert_eq!(lens.project(lens.position()), None);
            let unknown = lens.ray(DVec2::NAN);
            assert!(unknown.is_none(), "{unknown:?}");
        }
    }

    #[test]
    fn axes_point_right_down_and_forward() {
        for (lens, _) in lenses() {
            let mut camera = camera(lens);
            camera.world_from_camera = DAffine3::IDENTITY;
            let middle = camera.ray(camera.center_px).expect("on the axis");
            assert!(middle.direction.distance(-DVec3::Z) < 1e-14 && middle.origin == DVec3::ZERO);
            let point = |pixel| {
                let ray = camera.ray(camera.center_px + pixel).expect("near the axis");
                ray.origin + ray.direction
            };
            assert!(point(DVec2::X).x > 0.0 && point(DVec2::Y).y < 0.0, "{lens:?}");
            assert_eq!(camera.forward(), -DVec3::Z);
            let behind = camera.project(DVec3::new(0.0, 1e-9, 1.0));
            let sees_behind = match lens {
                Lens::Fisheye { k } => k[0] >= 0.0,
                other => other == Lens::Equirectangular,
            };
            assert_eq!(behind.is_some(), sees_behind, "{lens:?}");
        }
    }

    #[test]
    fn a_sphere_is_unrolled_from_its_middle() {
        let mut camera = camera(Lens::Equirectangular);
        camera.world_from_camera = DAffine3::IDENTITY;
        let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
        let seen = |x: f64, y: f64| camera.ray(DVec2::new(x, y) * size).expect("on the sphere").direction;
        for (at, direction) in [
            (seen(0.5, 0.5), DVec3::NEG_Z),
            (seen(0.75, 0.5), DVec3::X),
            (seen(0.25, 0.5), DVec3::NEG_X),
            (seen(0.0, 0.5), DVec3::Z),
            (seen(1.0, 0.5), DVec3::Z),
            (seen(0.3, 0.0), DVec3::Y),
            (seen(0.3, 1.0), DVec3::NEG_Y),
        ] {
            assert!(at.distance(direction) < 1e-14, "{at} {direction}");
        }
    }

    #[test]
    fn a_fisheye_sees_angles_as_lengths() {
        let mut camera = camera(Lens::Fisheye { k: [0.1, 0.0, 0.0, 0.0] });
        camera.world_from_camera = DAffine3::IDENTITY;
        let (pixel, depth) = camera.project(DVec3::new(0.0, -3.0, 0.0)).expect("a right angle");
        let radius = FRAC_PI_2 * (1.0 + 0.1 * FRAC_PI_2 * FRAC_PI_2);
        assert!(pixel.distance(camera.center_px + radius * camera.focal_px * DVec2::Y) < 1e-9);
        assert!((depth - 3.0).abs() < 1e-15);
    }

    #[test]
    fn parallel_rays_start_side_by_side() {
        let camera = camera(Lens::Orthographic);
        let ray = |x: f64, y: f64| camera.ray(camera.center_px + DVec2::new(x, y)).expect("everywhere");
        let (right, down) = (ray(402.0, 0.0), ray(0.0, 395.0));
        let axes = camera.world_from_camera.matrix3;
        assert!(right.origin.distance(camera.position() + axes.x_axis) < 1e-12);
        assert!(down.origin.distance(camera.position() - axes.y_axis) < 1e-12);
        assert_eq!(right.direction, down.direction);
    }

    #[test]
    fn a_cropped_camera_sees_the_same() {
        let camera = camera(lenses()[1].0);
        let part = camera.cropped([30, 200], [500, 700]);
        assert_eq!((part.width, part.height), (500, 700));
        let whole = camera.ray(DVec2::new(100.0, 250.0)).expect("inside");
        let same = part.ray(DVec2::new(70.0, 50.0)).expect("inside");
        assert!(whole.direction.distance(same.direction) < 1e-14);
    }

    #[test]
    fn a_footprint_holds_the_image_of_a_ball() {
        for lens in [
            Lens::Orthographic,
            Lens::Equirectangular,
            Lens::Fisheye { k: [0.0; 4] },
            Lens::Fisheye { k: [-0.02, 0.003, -0.0006, 0.00001] },
            Lens::Fisheye { k: [0.4, 0.2, 0.1, 0.05] },
            Lens::Fisheye { k: [-0.25, 0.02, 0.0, 0.0] },
        ] {
            let camera = camera(lens);
            let (mut held, mut largest) = (0, 0.0f64);
            for index in 0..400 {
                let turn = f64::from(index) * 2.4;
                let height = 1.0 - (f64::from(index) + 0.5) / 200.0;
                let flat = (1.0 - height * height).sqrt();
                let out = DVec3::new(flat * turn.cos(), flat * turn.sin(), height);
                let (center, radius) = (
                    camera.position() + 3.0 * out,
                    0.05 + 0.002 * f64::from(index % 100) * f64::from(index % 7),
                );
                let Some((middle, reach)) = camera.footprint(center, radius) else { continue };
                held += 1;
                for step in 0..60 {
                    let turn = f64::from(step) * 2.4;
                    let side = DVec3::new(turn.cos(), turn.sin(), 0.1 * f64::from(step) - 3.0).normalize();
                    let Some((pixel, _)) = camera.project(center + radius * side) else { continue };
                    assert!(pixel.distance(middle) <= reach * (1.0 + 1e-9), "{lens:?} {out} {radius}");
                    largest = largest.max(pixel.distance(middle) / reach);
                }
            }
            assert!(held > 50 && largest > 0.8, "{lens:?}: {held} footprints, {largest} of them filled");
        }
    }

    #[test]
    fn a_resized_camera_sees_the_same() {
        for (lens, _) in lenses() {
            let camera = camera(lens);
            let small = camera.resized(270, 480);
            let full = camera.ray(DVec2::new(300.0, 700.0)).expect("inside");
            let quarter = small.ray(DVec2::new(75.0, 175.0)).expect("inside");
            assert!(full.direction.distance(quarter.direction) < 1e-14);
            assert!(full.origin.distance(quarter.origin) < 1e-14);
        }
    }
}
