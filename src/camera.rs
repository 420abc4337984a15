//! Cameras: pose, intrinsics and lens, from a pixel to a ray in the dataset's world space.
//!
//! Camera axes are OpenGL's: +X right, +Y up, the camera looks along -Z. Pixel space has its origin at
//! the top-left corner of the image, +x right and +y down; the centre of pixel `(i, j)` is
//! `(i + 0.5, j + 0.5)`.

use glam::{DAffine3, DMat2, DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// One camera. Lengths are in world units, image quantities in pixels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Focal lengths along x and y, in pixels.
    pub focal_px: DVec2,
    /// Principal point, in pixels from the top-left corner.
    pub center_px: DVec2,
    /// Distortion applied by the lens.
    pub lens: Lens,
    /// Camera-to-world pose: a rotation (orthonormal, determinant +1) and a translation.
    pub world_from_camera: DAffine3,
}

/// How a lens bends the ideal pinhole projection.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Lens {
    /// No distortion.
    #[default]
    Pinhole,
    /// OpenCV's radial-tangential model:
    /// `x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸) + 2 p1 x y + p2 (r² + 2 x²)` and
    /// `y_d = y (1 + …) + p1 (r² + 2 y²) + 2 p2 x y`, with y pointing down.
    OpenCv {
        /// Radial coefficients k1..k4.
        k: [f64; 4],
        /// Tangential coefficients p1, p2.
        p: [f64; 2],
    },
}

/// A ray in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where the ray starts: the camera's position.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
}

impl Camera {
    /// The world-space ray through a point of the image (pixel space), or `None` where the lens maps
    /// no direction to that point (beyond the rim of a strong distortion).
    pub fn ray(&self, pixel: DVec2) -> Option<Ray> {
        let plane = self.lens.undistort((pixel - self.center_px) / self.focal_px)?;
        let direction = DVec3::new(plane.x, -plane.y, -1.0);
        Some(Ray {
            origin: self.position(),
            direction: self.world_from_camera.transform_vector3(direction).normalize(),
        })
    }

    /// Where a world-space point appears in pixel space, and its depth along the view axis in world
    /// units; `None` behind the camera and where the lens model folds over. The point may lie outside
    /// the image.
    pub fn project(&self, world: DVec3) -> Option<(DVec2, f64)> {
        let camera = self.world_from_camera.inverse().transform_point3(world);
        let depth = -camera.z;
        if depth.is_nan() || depth <= 0.0 {
            return None;
        }
        let plane = DVec2::new(camera.x, -camera.y) / depth;
        let bent = self.lens.distort(plane);
        // A polynomial lens brings points far outside the field of view back into the image.
        let back = self.lens.undistort(bent)?;
        (back.distance(plane) <= 1e-6 * (1.0 + plane.length()))
            .then(|| (bent * self.focal_px + self.center_px, depth))
    }

    /// Unit view direction in world space.
    pub fn forward(&self) -> DVec3 {
        -self.world_from_camera.matrix3.z_axis
    }

    /// Centre of projection in world space.
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

impl Lens {
    /// From the ideal to the distorted point; both on the normalised image plane, y down.
    pub fn distort(&self, ideal: DVec2) -> DVec2 {
        match self {
            Self::Pinhole => ideal,
            Self::OpenCv { k, p } => {
                let r2 = ideal.length_squared();
                let radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * (k[2] + r2 * k[3])));
                let xy = ideal.x * ideal.y;
                ideal * radial
                    + DVec2::new(
                        2.0 * p[0] * xy + p[1] * (r2 + 2.0 * ideal.x * ideal.x),
                        p[0] * (r2 + 2.0 * ideal.y * ideal.y) + 2.0 * p[1] * xy,
                    )
            }
        }
    }

    /// From the distorted to the ideal point, the inverse of [`Lens::distort`] on the region around the
    /// optical axis where the model is one-to-one; `None` for points that region does not reach.
    pub fn undistort(&self, distorted: DVec2) -> Option<DVec2> {
        if *self == Self::Pinhole {
            return Some(distorted);
        }
        // The solution is followed from the axis (where ideal = distorted = 0) outwards, in one stride
        // for ordinary lenses and in shorter ones near a fold: Newton from the far end alone may land on
        // a branch beyond the fold.
        let mut ideal = DVec2::ZERO;
        let mut reached = 0.0;
        let mut stride = 1.0;
        while reached < 1.0 {
            let next = f64::min(reached + stride, 1.0);
            match self.newton(ideal, distorted * reached, distorted * next) {
                Some(solution) => {
                    ideal = solution;
                    reached = next;
                    stride *= 2.0;
                }
                None => stride *= 0.5,
            }
            if stride < 1e-6 {
                return None;
            }
        }
        Some(ideal)
    }

    /// Solves `distort(x) = target` from the known solution `start` of `distort(start) = origin`, or
    /// gives up when the solution is not safely on the branch of `start`.
    fn newton(&self, start: DVec2, origin: DVec2, target: DVec2) -> Option<DVec2> {
        let slope_at_start = self.jacobian(start);
        let predicted_step = slope_at_start.inverse() * (target - origin);
        let mut ideal = start + predicted_step;
        let mut last_step = f64::INFINITY;
        for _ in 0..12 {
            let slope = self.jacobian(ideal);
            let determinant = slope.determinant();
            if determinant.is_nan() || determinant <= 0.05 * slope_at_start.determinant() {
                return None;
            }
            let step = slope.inverse() * (target - self.distort(ideal));
            ideal += step;
            if ideal.distance(start + predicted_step) > 0.5 * predicted_step.length() + 1e-15 {
                return None;
            }
            let size = step.length();
            if size <= 4e-16 * (1.0 + ideal.length()) || (size >= last_step && size < 1e-13) {
                return Some(ideal);
            }
            last_step = size;
        }
        None
    }

    /// Derivative of [`Lens::distort`].
    fn jacobian(&self, ideal: DVec2) -> DMat2 {
        match self {
            Self::Pinhole => DMat2::IDENTITY,
            Self::OpenCv { k, p } => {
                let DVec2 { x, y } = ideal;
                let r2 = ideal.length_squared();
                let radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * (k[2] + r2 * k[3])));
                let d_radial = 2.0 * (k[0] + r2 * (2.0 * k[1] + r2 * (3.0 * k[2] + r2 * 4.0 * k[3])));
                let mixed = d_radial * x * y + 2.0 * (p[0] * x + p[1] * y);
                DMat2::from_cols(
                    DVec2::new(radial + d_radial * x * x + 2.0 * p[0] * y + 6.0 * p[1] * x, mixed),
                    DVec2::new(mixed, radial + d_radial * y * y + 6.0 * p[0] * y + 2.0 * p[1] * x),
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    fn camera(lens: Lens) -> Camera {
        Camera {
            width: 1080,
            height: 1920,
            focal_px: DVec2::new(1375.5, 1371.2),
            center_px: DVec2::new(554.6, 965.3),
            lens,
            world_from_camera: DAffine3::from_rotation_translation(
                DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.3),
                DVec3::new(3.0, -2.0, 0.5),
            ),
        }
    }

    fn lenses() -> Vec<Lens> {
        let open_cv = |k, p| Lens::OpenCv { k, p };
        vec![
            Lens::Pinhole,
            open_cv([0.0578, -0.0805, 0.0, 0.0], [-9.8e-4, 1.6e-4]),
            open_cv([-0.35, 0.15, -0.03, 0.0], [0.003, -0.002]),
            open_cv([0.48, 0.9, 0.3, 0.1], [0.02, -0.01]),
            open_cv([-0.15, 0.0, 0.0, 0.0], [0.0, 0.0]),
        ]
    }

    #[test]
    fn a_ray_projects_back_onto_its_pixel() {
        for lens in lenses() {
            let camera = camera(lens);
            for (i, j) in (0..=20).flat_map(|i| (0..=20).map(move |j| (i, j))) {
                let pixel = DVec2::new(f64::from(i) * 54.0, f64::from(j) * 96.0);
                let ray = camera.ray(pixel).expect("inside the lens");
                let (back, depth) = camera.project(ray.origin + 7.0 * ray.direction).expect("in front");
                assert!(back.distance(pixel) < 1e-8, "{lens:?} {pixel} -> {back}");
                assert!((depth - 7.0 * ray.direction.dot(camera.forward())).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn beyond_the_rim_of_a_lens_there_is_no_ray() {
        // r (1 - 0.4 r²) peaks at r = 0.9129 with the value 0.6086.
        let lens = Lens::OpenCv { k: [-0.4, 0.0, 0.0, 0.0], p: [0.0; 2] };
        assert!(lens.undistort(DVec2::new(0.608, 0.0)).is_some());
        assert_eq!(lens.undistort(DVec2::new(0.609, 0.0)), None);
        assert_eq!(lens.undistort(DVec2::new(f64::NAN, 0.0)), None);
        let camera = camera(lens);
        let folded = DVec3::new(1.3, 0.0, -1.0);
        assert_eq!(camera.project(camera.world_from_camera.transform_point3(folded)), None);
    }

    #[test]
    fn the_jacobian_is_the_derivative() {
        let at = DVec2::new(0.31, -0.22);
        for lens in lenses() {
            let analytic = lens.jacobian(at);
            for (axis, column) in [(DVec2::X, analytic.x_axis), (DVec2::Y, analytic.y_axis)] {
                let h = 1e-6;
                let slope = (lens.distort(at + h * axis) - lens.distort(at - h * axis)) / (2.0 * h);
                assert!(slope.distance(column) < 1e-8, "{lens:?}");
            }
        }
    }

    #[test]
    fn axes_point_right_down_and_forward() {
        let mut camera = camera(Lens::Pinhole);
        camera.world_from_camera = DAffine3::IDENTITY;
        let right = camera.ray(camera.center_px + DVec2::X).expect("pinhole");
        let down = camera.ray(camera.center_px + DVec2::Y).expect("pinhole");
        assert!(right.direction.x > 0.0 && down.direction.y < 0.0);
        assert_eq!(camera.forward(), -DVec3::Z);
        assert_eq!(camera.project(DVec3::Z), None);
    }

    #[test]
    fn a_cropped_camera_sees_the_same() {
        let camera = camera(lenses()[1]);
        let part = camera.cropped([30, 200], [500, 700]);
        assert_eq!((part.width, part.height), (500, 700));
        let whole = camera.ray(DVec2::new(100.0, 250.0)).expect("inside");
        let same = part.ray(DVec2::new(70.0, 50.0)).expect("inside");
        assert!(whole.direction.distance(same.direction) < 1e-14);
    }

    #[test]
    fn a_resized_camera_sees_the_same() {
        let camera = camera(lenses()[1]);
        let small = camera.resized(270, 480);
        let full = camera.ray(DVec2::new(100.0, 200.0)).expect("inside");
        let quarter = small.ray(DVec2::new(25.0, 50.0)).expect("inside");
        assert!(full.direction.distance(quarter.direction) < 1e-14);
    }
}
