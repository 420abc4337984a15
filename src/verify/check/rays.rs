//! Rays through pixels: those of a view through every lens, and those of a training run with their targets.

mod training_rays;
mod view_rays;

pub use training_rays::{drawn, training_rays};
pub use view_rays::{sharp_rays, view_rays};

use super::Workbench;
use super::inputs::Random;
use crate::camera::Bounds;
use crate::camera::{Camera, Lens, LensKind};
use crate::field::{self, Progress};
use anyhow::Result;
use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use std::f64::consts::{PI, TAU};
use std::ops::Range;

/// A ray as the device stores it, in box space.
#[derive(Clone, Copy, Debug)]
pub struct DeviceRay {
    /// Where it starts.
    pub origin: DVec3,
    /// Its direction.
    pub direction: DVec3,
    /// Where it enters the box.
    pub t_near: f64,
    /// Where it leaves it.
    pub t_far: f64,
}

impl DeviceRay {
    /// The first `count` rays on the device.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn read(bench: &Workbench, count: usize) -> Result<Vec<Self>> {
        let vector = |[x, y, z, _]: [f32; 4]| DVec3::from_array([x, y, z].map(f64::from));
        let ray = |[origin, direction]: [[f32; 4]; 2]| Self {
            origin: vector(origin),
            direction: vector(direction),
            t_near: f64::from(origin[3]),
            t_far: f64::from(direction[3]),
        };
        Ok(bench.rays(count)?.into_iter().map(ray).collect())
    }
}

/// A camera of one pixel whose only ray goes along `direction`, all of it in box space.
#[must_use]
pub fn pixel_camera(origin: DVec3, direction: DVec3) -> field::DeviceCamera {
    let right = direction.any_orthonormal_vector();
    let array = |vector: DVec3| vector.as_vec3().to_array();
    field::DeviceCamera {
        origin: array(origin),
        width: 1,
        right: array(right),
        height: 1,
        up: array(right.cross(-direction)),
        back: array(-direction),
        focal_px: [1.0; 2],
        center_px: [0.5; 2],
        ..field::DeviceCamera::default()
    }
}

/// Frees a slot for the ray of each of these pixels of a view.
pub fn begin_rays(bench: &Workbench, pixels: Range<usize>) {
    let free: Vec<[u32; 2]> = (0..pixels.len() as u32).map(|slot| [slot, 1]).collect();
    let (first_pixel, next_pixel) = (pixels.start as u32, pixels.end as u32);
    bench.write("view_slots", &free);
    bench.write("progress", &[Progress { first_pixel, next_pixel, ..Progress::default() }]);
    bench.set_rays(pixels.len());
}

fn bounds() -> Bounds {
    Bounds {
        center: DVec3::new(0.5, -1.0, 2.0),
        half: 1.5,
        cascades: 1,
        source: String::new(),
        is_guess: false,
    }
}

/// A camera that looks at the box, its principal point off the centre; every second world is left-handed.
fn camera(random: &mut Random, (width, height): (u32, u32), lens: Lens) -> Camera {
    let rotation = DQuat::from_rotation_y(random.number(-3.0, 3.0))
        * DQuat::from_rotation_x(random.number(-1.2, 1.2))
        * DQuat::from_rotation_z(random.number(-3.0, 3.0));
    let size = DVec2::new(f64::from(width), f64::from(height));
    let hand =
        DMat3::from_diagonal(DVec3::new(if random.number(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 }, 1.0, 1.0));
    Camera {
        width,
        height,
        focal_px: focal_px(size.max(DVec2::splat(4.0)), lens.kind()),
        center_px: size * DVec2::new(0.43, 0.61),
        lens,
        world_from_camera: DAffine3::from_mat3_translation(
            DMat3::from_quat(rotation) * hand,
            bounds().center + rotation * DVec3::new(0.2, -0.1, random.number(1.0, 5.0)),
        ),
    }
}

/// Focal lengths with which an image of this size shows what its kind of lens is used for: half a right angle to
/// each side, a hemisphere and more, the box, the whole sphere.
fn focal_px(size: DVec2, kind: LensKind) -> DVec2 {
    match kind {
        LensKind::Pinhole | LensKind::OpenCv => DVec2::new(0.81, 0.77) * size.x,
        LensKind::Fisheye => DVec2::new(0.31, 0.30) * size.x,
        LensKind::Orthographic => DVec2::new(0.42, 0.41) * size.x,
        LensKind::Equirectangular => size / DVec2::new(TAU, PI),
    }
}

/// Whether rounding decides if there is a ray: a little nearer to the centre or farther from it there is another
/// answer.
fn is_close_to_a_fold(camera: &Camera, pixel: DVec2) -> bool {
    let seen = |scale: f64| camera.ray(camera.center_px + (pixel - camera.center_px) * scale).is_some();
    [0.97, 1.03].iter().any(|&scale| seen(scale) != seen(1.0))
}
