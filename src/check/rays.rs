//! Rays through the pixels of a view, through every lens.

use super::draw::{Random, SEED, STEP, quiet_step};
use super::{Setup, Subject, Tally, Workbench};
use crate::camera::{Camera, Lens};
use crate::dataset::Bounds;
use crate::gpu::pass::Stage;
use crate::kernels::{self, Step, dimension, viewing};
use crate::reference::lens::Distortion;
use crate::reference::march::{BoxRay, box_interval};
use crate::reference::random::random_u32;
use anyhow::Result;
use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};

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

/// Lenses of a phone and of an action camera, a wide one, a strong barrel that folds within the image, and a
/// pincushion.
pub(super) const LENSES: [(&str, Lens); 7] = [
    ("pinhole", Lens::Pinhole),
    ("no distortion", open_cv([0.0; 4], [0.0; 2])),
    ("mild", open_cv([0.05, -0.08, 0.02, 0.0], [1e-3, -5e-4])),
    ("action", open_cv([-0.27, 0.11, -0.03, 0.004], [2e-3, 1e-3])),
    ("wide", open_cv([-0.36, 0.18, -0.045, 0.0045], [-2e-3, 3e-3])),
    ("fold", open_cv([-0.45, 0.05, 0.0, 0.0], [1e-3, 2e-3])),
    ("pincushion", open_cv([0.35, 0.12, 0.01, 0.0], [-3e-3, 2e-3])),
];

const fn open_cv(k: [f64; 4], p: [f64; 2]) -> Lens {
    Lens::OpenCv { k, p }
}

pub(super) fn bounds() -> Bounds {
    Bounds { center: DVec3::new(0.5, -1.0, 2.0), half: 1.5, cascades: 1, source: String::new() }
}

/// A camera that looks at the box, its principal point off the centre.
pub(super) fn camera(random: &mut Random, (width, height): (u32, u32), lens: Lens) -> Camera {
    let rotation = DQuat::from_rotation_y(random.number(-3.0, 3.0))
        * DQuat::from_rotation_x(random.number(-1.2, 1.2))
        * DQuat::from_rotation_z(random.number(-3.0, 3.0));
    let size = DVec2::new(f64::from(width), f64::from(height));
    Camera {
        width,
        height,
        focal_px: DVec2::new(0.81, 0.77) * size.x.max(4.0),
        center_px: size * DVec2::new(0.43, 0.61),
        lens,
        world_from_camera: DAffine3::from_mat3_translation(
            DMat3::from_quat(rotation),
            bounds().center + rotation * DVec3::new(0.2, -0.1, random.number(1.0, 5.0)),
        ),
    }
}

/// Whether rounding decides if there is a ray: a little nearer to the centre or farther from it there is another
/// answer.
pub(super) fn is_close_to_a_fold(camera: &Camera, pixel: DVec2) -> bool {
    let seen = |scale: f64| camera.ray(camera.center_px + (pixel - camera.center_px) * scale).is_some();
    [0.97, 1.03].iter().any(|&scale| seen(scale) != seen(1.0))
}

/// Every pixel of a view through every lens: its direction, where it is in the box, and its way back through the
/// lens in pixels.
///
/// # Errors
/// When the device was lost or refuses a kernel.
pub fn view_rays(subject: &Subject) -> Result<Vec<Tally>> {
    let mut rays = Tally::new("rays of a view", 6e-7, "a rotation, a unit vector and six quotients round");
    let mut trips = Tally::new(
        "lens: round trips",
        6e-7,
        "pixels over the focal length; Newton's method stops within 1e-7 of the image plane",
    );
    let mut random = Random::new(40);
    for linked in [false, true] {
        let mut setup = Setup::tiny();
        setup.needs.lens = linked;
        let mut bench = subject.workbench(setup)?;
        bench.workspace.allocate(&bench.gpu, &viewing::demands(&bench.plan))?;
        let stage = viewing::rays(&bench.gpu, &bench.plan, &bench.workspace)?;
        for (name, lens) in LENSES.into_iter().filter(|(_, lens)| linked == (*lens != Lens::Pinhole)) {
            let camera = camera(&mut random, (17, 13), lens);
            let view = View { name, camera, bench: &bench, stage: &stage };
            view.compare(&mut rays, &mut trips)?;
        }
    }
    Ok(vec![rays, trips])
}

/// A view on a workbench.
struct View<'a> {
    name: &'static str,
    camera: Camera,
    bench: &'a Workbench,
    stage: &'a Stage,
}

impl View<'_> {
    fn compare(&self, rays: &mut Tally, trips: &mut Tally) -> Result<()> {
        let Self { name, camera, .. } = self;
        let mut none = 0;
        for (index, ray) in self.draw()?.into_iter().enumerate() {
            let (x, y) = (index as u32 % camera.width, index as u32 / camera.width);
            let pixel = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
            if is_close_to_a_fold(camera, pixel) {
                continue;
            }
            let case = || format!("{name}, pixel {pixel}");
            let Some(want) = camera.ray(pixel) else {
                none += 1;
                rays.holds(ray.t_far <= ray.t_near, || format!("{}: there is no ray", case()));
                continue;
            };
            let origin = (want.origin - bounds().min()) / (2.0 * bounds().outer_half());
            rays.holds(ray.origin.as_vec3() == origin.as_vec3(), || format!("{}: origin", case()));
            for axis in 0..3 {
                rays.value(ray.direction[axis], want.direction[axis], 1.0, case);
            }
            compare_interval(rays, &ray, self.bench.plan.config.march.near, case);
            let back = self.image_of(ray.direction);
            let miss = (back - pixel).length() / camera.focal_px.min_element();
            trips.error(miss, || format!("{}: back at {back}", case()));
        }
        rays.holds((*name == "fold") == (none > 0), || format!("{name}: {none} pixels without a ray"));
        Ok(())
    }

    /// The rays, in two chunks of which the second starts in the middle of a row.
    fn draw(&self) -> Result<Vec<DeviceRay>> {
        let Self { camera, bench, .. } = self;
        bench.write("cameras", &[kernels::Camera::in_box(camera, &bounds())]);
        let pixels = (camera.width * camera.height) as usize;
        let mut rays = Vec::new();
        for (first, count) in [(0, 130), (130, pixels - 130)] {
            bench.set_rays(count);
            bench.set_step(Step { first_pixel: first as u32, ..quiet_step() });
            bench.run([self.stage])?;
            rays.extend(DeviceRay::read(bench, count)?);
        }
        Ok(rays)
    }

    /// The pixel position that a direction is imaged at.
    fn image_of(&self, direction: DVec3) -> DVec2 {
        let Camera { world_from_camera, lens, focal_px, center_px, .. } = &self.camera;
        let seen = world_from_camera.matrix3.transpose() * direction;
        let ideal = DVec2::new(seen.x, -seen.y) / -seen.z;
        let distorted = match *lens {
            Lens::OpenCv { k, p } => Distortion { k, p }.distort(ideal),
            _ => ideal,
        };
        distorted * *focal_px + *center_px
    }
}

/// Where a ray is in the box, from its own origin and direction.
fn compare_interval(tally: &mut Tally, ray: &DeviceRay, near: f64, case: impl Fn() -> String) {
    let want = box_interval(BoxRay { origin: ray.origin, direction: ray.direction }, near);
    match want {
        // A graze that rounding decides.
        Some([t_near, t_far]) if t_far - t_near < 1e-5 => {}
        Some([t_near, t_far]) => {
            tally.value(ray.t_near, t_near, 1.0 + t_near, || format!("{}: into the box", case()));
            tally.value(ray.t_far, t_far, 1.0 + t_far, || format!("{}: out of the box", case()));
        }
        None => tally.holds(ray.t_far - ray.t_near < 1e-5, || format!("{}: past the box", case())),
    }
}

/// Which view and which of its pixels, of which each has so many, the kernel draws for a ray.
#[must_use]
pub fn drawn(ray: usize, pixels: &[u32]) -> (usize, u32) {
    let draw = |dimension| random_u32(SEED, STEP, ray as u32, dimension);
    let view = draw(dimension::IMAGE) as usize % pixels.len();
    (view, draw(dimension::PIXEL) % pixels[view])
}

/// A camera of one pixel whose only ray goes along `direction`, all of it in box space.
#[must_use]
pub fn pixel_camera(origin: DVec3, direction: DVec3) -> kernels::Camera {
    let right = direction.any_orthonormal_vector();
    let array = |vector: DVec3| vector.as_vec3().to_array();
    kernels::Camera {
        origin: array(origin),
        width: 1,
        right: array(right),
        height: 1,
        up: array(right.cross(-direction)),
        back: array(-direction),
        focal_px: [1.0; 2],
        center_px: [0.5; 2],
        pixel_count: 1,
        ..kernels::Camera::default()
    }
}
