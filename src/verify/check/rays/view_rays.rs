//! Rays of a view, through every lens.

use super::{DeviceRay, begin_rays, bounds, camera, is_close_to_a_fold};
use crate::camera::{Camera, Lens, LensKind};
use crate::field::{self, viewing};
use crate::gpu::pass::Stage;
use crate::verify::check::inputs::Random;
use crate::verify::check::{CheckResult, CheckedAdapter, Setup, Workbench};
use crate::verify::reference::lens::{self, LensRay};
use crate::verify::reference::march::{BoxRay, box_interval};
use anyhow::Result;
use glam::{DVec2, DVec3};

/// A lens, and what is to be said of it.
struct LensModel {
    name: &'static str,
    lens: Lens,
    /// Whether its rim lies within the image.
    has_rim: bool,
    /// Whether the rounding of a ray is more than an ordinary fraction of a pixel in a large image: where the lens
    /// spreads a small angle over many pixels, or the rays start far out in the box.
    is_steep: bool,
}

const fn model(name: &'static str, lens: Lens) -> LensModel {
    LensModel { name, lens, has_rim: false, is_steep: false }
}

const fn open_cv(name: &'static str, k: [f64; 4], p: [f64; 2]) -> LensModel {
    model(name, Lens::OpenCv { k, p })
}

const fn fisheye(name: &'static str, k: [f64; 4]) -> LensModel {
    model(name, Lens::Fisheye { k })
}

const fn steep(model: LensModel) -> LensModel {
    LensModel { is_steep: true, ..model }
}

const fn with_rim(model: LensModel) -> LensModel {
    LensModel { has_rim: true, ..model }
}

/// Lenses of a phone and of an action camera, wide ones, strong barrels that fold within the image, and pincushions.
const MODELS: [LensModel; 16] = [
    model("pinhole", Lens::Pinhole),
    open_cv("no distortion", [0.0; 4], [0.0; 2]),
    open_cv("mild", [0.05, -0.08, 0.02, 0.0], [1e-3, -5e-4]),
    open_cv("action", [-0.27, 0.11, -0.03, 0.004], [2e-3, 1e-3]),
    open_cv("wide", [-0.36, 0.18, -0.045, 0.0045], [-2e-3, 3e-3]),
    with_rim(open_cv("fold", [-0.45, 0.05, 0.0, 0.0], [1e-3, 2e-3])),
    with_rim(open_cv("fold that unfolds", [-0.9, 0.35, 0.0, 0.0], [5e-3, -8e-3])),
    steep(open_cv("pincushion", [0.35, 0.12, 0.01, 0.0], [-3e-3, 2e-3])),
    fisheye("equidistant", [0.0; 4]),
    fisheye("fisheye", [-0.02, 0.003, -0.0004, 0.00002]),
    with_rim(fisheye("fisheye with a fold", [-0.1, 0.0, 0.0, 0.0])),
    with_rim(fisheye("fisheye that unfolds", [-0.25, 0.02, 0.0, 0.0])),
    steep(fisheye("flat fisheye", [-0.1, 0.08, -0.022, 0.0019])),
    steep(fisheye("strong fisheye", [0.5, 0.3, 0.1, 0.05])),
    steep(model("orthographic", Lens::Orthographic)),
    with_rim(model("equirectangular", Lens::Equirectangular)),
];

/// Every pixel of a view through every lens, linked alone and among all others: its ray, where it is in the box, and
/// its way back through the lens.
///
/// # Errors
/// When the device was lost or refuses a kernel.
pub fn view_rays(adapter: &CheckedAdapter) -> Result<Vec<CheckResult>> {
    let mut rays =
        CheckResult::new("rays of a view", 6e-7, "a rotation, a unit vector and six quotients round");
    let mut trips = trips("lens: round trips");
    let mut random = Random::new(40);
    let mixed = LensKind::ALL.to_vec();
    for linked in LensKind::ALL.map(|kind| vec![kind]).into_iter().chain([mixed]) {
        let bench = ViewBench::new(adapter, &linked, 256)?;
        for model in MODELS.iter().filter(|model| linked.contains(&model.lens.kind())) {
            let camera = camera(&mut random, (17, 13), model.lens);
            let none = BenchView::new(model, camera, &bench).compare(&mut rays, &mut trips)?;
            rays.holds(model.has_rim == (none > 0), || {
                format!("{}: {none} pixels without a ray", model.name)
            });
        }
    }
    Ok(vec![rays, trips])
}

/// Pixel to ray to pixel in images that are a thousand pixels wide.
///
/// # Errors
/// When the device was lost or refuses a kernel.
pub fn sharp_rays(adapter: &CheckedAdapter) -> Result<Vec<CheckResult>> {
    let mut pixels = CheckResult::new(
        "lens: pixels of a large image",
        2e-4,
        "a direction and the point of the plane it goes through round, 1500 pixels to the radian",
    );
    let mut angles = trips("lens: large images");
    let mut random = Random::new(42);
    let bench = ViewBench::new(adapter, &LensKind::ALL, 1024)?;
    for model in &MODELS {
        let camera = camera(&mut random, (1000, 750), model.lens);
        BenchView::new(model, camera, &bench).measure(&mut pixels, &mut angles)?;
    }
    Ok(vec![pixels, angles])
}

/// Errors of pixels over how much the lens stretches.
fn trips(name: &str) -> CheckResult {
    CheckResult::new(
        name,
        4e-7,
        "in radians or box units: a rotation and six more roundings, and Newton's method's last step",
    )
}

/// A workbench for views of cameras with some lenses.
struct ViewBench {
    bench: Workbench,
    stage: Stage,
}

impl ViewBench {
    fn new(adapter: &CheckedAdapter, lenses: &[LensKind], rays: usize) -> Result<Self> {
        let mut setup = Setup::tiny();
        setup.features.lenses = lenses.iter().copied().collect();
        setup.bounds = super::bounds();
        setup.config.batch.rays = rays;
        let mut bench = adapter.workbench(setup)?;
        bench.workspace.allocate(&bench.gpu, &viewing::buffers(&bench.plan))?;
        let stage = viewing::rays(&bench.gpu, &bench.plan, &bench.workspace)?;
        Ok(Self { bench, stage })
    }
}

/// A view on a workbench.
struct BenchView<'a> {
    name: &'static str,
    /// See [`LensModel::is_steep`].
    is_steep: bool,
    camera: Camera,
    bench: &'a ViewBench,
}

impl<'a> BenchView<'a> {
    fn new(model: &LensModel, camera: Camera, bench: &'a ViewBench) -> Self {
        Self { name: model.name, is_steep: model.is_steep, camera, bench }
    }

    /// Compares all pixels; returns how many have no ray.
    fn compare(&self, rays: &mut CheckResult, trips: &mut CheckResult) -> Result<usize> {
        let Self { name, camera, bench, .. } = self;
        let mut none = 0;
        // Two chunks of which the second starts in the middle of a row.
        let pixels = (camera.width * camera.height) as usize;
        let drawn = [self.draw(0, 130)?, self.draw(130, pixels - 130)?].concat();
        for (index, ray) in drawn.into_iter().enumerate() {
            let pixel = self.pixel(index);
            if is_close_to_a_fold(camera, pixel) {
                continue;
            }
            let case = || format!("{name}, pixel {pixel}");
            let Some(want) = self.want(pixel) else {
                none += 1;
                rays.holds(ray.t_far <= ray.t_near, || format!("{}: there is no ray", case()));
                continue;
            };
            for axis in 0..3 {
                rays.value(ray.direction[axis], want.direction[axis], 1.0, case);
                rays.value(
                    ray.origin[axis],
                    want.origin[axis],
                    1.0 + want.origin.abs().max_element(),
                    || format!("{}: origin", case()),
                );
            }
            compare_interval(rays, &ray, bench.bench.plan.config.march.near, case);
            let back = self.image_of(&ray);
            let miss = (back - pixel).length() / self.stretch(&ray);
            trips.error(miss, || format!("{}: back at {back}", case()));
        }
        Ok(none)
    }

    /// Some rows of a large image, there and back: the error in pixels, and over what a ray moves the image.
    fn measure(&self, pixels: &mut CheckResult, angles: &mut CheckResult) -> Result<()> {
        let camera = &self.camera;
        for row in (0..camera.height).step_by(62).chain([camera.height - 1]) {
            let first = (row * camera.width) as usize;
            for (index, ray) in self.draw(first, camera.width as usize)?.into_iter().enumerate() {
                let pixel = self.pixel(first + index);
                if is_close_to_a_fold(camera, pixel) || camera.ray(pixel).is_none() {
                    continue;
                }
                let back = self.image_of(&ray);
                let case = || format!("{}, pixel {pixel} of {} x {}", self.name, camera.width, camera.height);
                angles.error((back - pixel).length() / self.stretch(&ray), case);
                if !self.is_steep {
                    pixels.error((back - pixel).length(), case);
                }
            }
        }
        Ok(())
    }

    /// The centre of a pixel.
    fn pixel(&self, index: usize) -> DVec2 {
        let width = self.camera.width as usize;
        DVec2::new((index % width) as f64 + 0.5, (index / width) as f64 + 0.5)
    }

    /// The ray through a point of the image, in box space.
    fn want(&self, pixel: DVec2) -> Option<BoxRay> {
        let Camera { world_from_camera: pose, lens, focal_px, center_px, .. } = &self.camera;
        let LensRay { start, direction } = lens::ray(lens, (pixel - center_px) / focal_px)?;
        let origin = (pose.transform_point3(start) - bounds().min()) / (2.0 * bounds().outer_half());
        Some(BoxRay { origin, direction: pose.transform_vector3(direction) })
    }

    /// The rays of `count` pixels from `first` on.
    fn draw(&self, first: usize, count: usize) -> Result<Vec<DeviceRay>> {
        let ViewBench { bench, stage } = self.bench;
        bench.write("view_camera", &[field::DeviceCamera::in_box(&self.camera, &bench.plan.space)]);
        begin_rays(bench, first..first + count);
        bench.run([stage])?;
        DeviceRay::read(bench, count)
    }

    /// The pixel position that a ray is imaged at.
    fn image_of(&self, ray: &DeviceRay) -> DVec2 {
        let Camera { world_from_camera, lens, focal_px, center_px, .. } = &self.camera;
        let start = match lens {
            Lens::Orthographic => {
                ray.origin * 2.0 * bounds().outer_half() + bounds().min() - world_from_camera.translation
            }
            _ => DVec3::ZERO,
        };
        let seen = world_from_camera.matrix3.transpose() * (start + ray.direction);
        lens::image(lens, seen) * *focal_px + *center_px
    }

    /// How many pixels the image of a ray moves at most per radian that it turns, or for parallel rays per box unit
    /// and the size of the numbers.
    fn stretch(&self, ray: &DeviceRay) -> f64 {
        const STEP: f64 = 1e-5;
        if self.camera.lens == Lens::Orthographic {
            let size = 1.0 + ray.origin.abs().max_element();
            return self.camera.focal_px.max_element() * 2.0 * bounds().outer_half() * size;
        }
        let (side, other) = ray.direction.any_orthonormal_pair();
        let turned = |by: DVec3| self.image_of(&DeviceRay { direction: ray.direction + by, ..*ray });
        let moved = |axis: DVec3| (turned(axis * STEP) - turned(-axis * STEP)) / (2.0 * STEP);
        moved(side).length().hypot(moved(other).length())
    }
}

/// Where a ray is in the box, from its own origin and direction.
fn compare_interval(result: &mut CheckResult, ray: &DeviceRay, near: f64, case: impl Fn() -> String) {
    let want = box_interval(BoxRay { origin: ray.origin, direction: ray.direction }, near);
    match want {
        // A graze that rounding decides.
        Some([t_near, t_far]) if t_far - t_near < 1e-5 => {}
        Some([t_near, t_far]) => {
            result.value(ray.t_near, t_near, 1.0 + t_near, || format!("{}: into the box", case()));
            result.value(ray.t_far, t_far, 1.0 + t_far, || format!("{}: out of the box", case()));
        }
        None => result.holds(ray.t_far - ray.t_near < 1e-5, || format!("{}: past the box", case())),
    }
}
