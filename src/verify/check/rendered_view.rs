//! A whole view through the renderer.

use super::inputs::Random;
use super::marching::reference;
use super::{CheckResult, CheckedAdapter, Setup, Workbench};
use crate::camera::Bounds;
use crate::camera::{Camera, Lens, LensKind};
use crate::config::Transmittance;
use crate::field::capacity::{LEAST_WEIGHT, Rounds};
use crate::field::renderer::{Renderer, View};
use crate::verify::reference::composite::{mean_depth, opacity, optical_depth, transmittances};
use crate::verify::reference::lens;
use crate::verify::reference::march::BoxRay;
use anyhow::Result;
use glam::{DAffine3, DMat3, DVec2, DVec3};

/// Transmittance at which a ray ends.
const STOP: f64 = 1e-6;
/// Size of the view.
const SIZE: (u32, u32) = (11, 9);

/// Colour, opacity and depth of every pixel, through every lens: of bounded scenes and of some with cascades, in sRGB
/// and linear light.
///
/// # Errors
/// When the device was lost or refuses a kernel.
pub fn rendered_views(adapter: &CheckedAdapter) -> Result<Vec<CheckResult>> {
    let mut shared = CheckResult::new(
        "rendered views: shared colours",
        2e-3,
        "a colour stands for that of samples whose weights sum to 0.001",
    );
    let mut result = CheckResult::new(
        "rendered views",
        2e-5,
        "sums of the networks round; a ray ends at a transmittance of 1e-6",
    );
    let lens = Lens::OpenCv { k: [-0.1, 0.02, 0.0, 0.0], p: [1e-3, -1e-3] };
    let fisheye = Lens::Fisheye { k: [-0.05, 0.01, 0.0, 0.0] };
    let mut rounds =
        CheckResult::new("rendered views: rounds", 1e-6, "the same sums, however they are parted");
    let scenes = [
        (1, false, Lens::Pinhole, Transmittance::Exclusive),
        (3, true, lens, Transmittance::Inclusive),
        (1, true, fisheye, Transmittance::Exclusive),
        (3, false, Lens::Orthographic, Transmittance::Exclusive),
        (1, false, Lens::Equirectangular, Transmittance::Exclusive),
    ];
    for (number, (cascades, hdr, lens, transmittance)) in scenes.into_iter().enumerate() {
        let mut setup = Setup::tiny().network(32, 2).hdr(hdr).transmittance(transmittance).cascades(cascades);
        setup.config.selection.stop_transmittance = STOP;
        (setup.bounds.center, setup.bounds.half) = (DVec3::new(1.0, 2.0, 3.0), 0.75);
        let bounds = setup.bounds.clone();
        let mut bench = adapter.workbench(setup)?;
        bench.randomise(&mut Random::new(90), 2.0, 1.5)?;
        bench.write("occupancy_bits", &vec![u32::MAX; bench.plan.cell_count() / 32]);
        let scene = ViewedScene { camera: camera(&bounds, lens), bounds };
        scene.compare(&mut shared, &bench)?;
        bench.plan.rounds.color_weight = LEAST_WEIGHT;
        let view = scene.compare(&mut result, &bench)?;
        if number < 2 {
            scene.compare_rounds(&mut rounds, &mut bench, &view)?;
        }
    }
    Ok(vec![result, shared, rounds])
}

/// What is seen, and from where.
struct ViewedScene {
    bounds: Bounds,
    camera: Camera,
}

fn camera(bounds: &Bounds, lens: Lens) -> Camera {
    let back = DVec3::new(0.3, -0.2, 1.0).normalize();
    let right = back.any_orthonormal_vector();
    Camera {
        width: SIZE.0,
        height: SIZE.1,
        focal_px: DVec2::splat(match lens.kind() {
            LensKind::Pinhole | LensKind::OpenCv => 13.0,
            LensKind::Fisheye => 5.0,
            LensKind::Orthographic => 4.0 / bounds.outer_half(),
            LensKind::Equirectangular => 3.0,
        }),
        center_px: DVec2::new(5.0, 4.0),
        lens,
        world_from_camera: DAffine3::from_mat3_translation(
            DMat3::from_cols(right, back.cross(right), back),
            bounds.center + 1.2 * back * bounds.outer_half(),
        ),
    }
}

impl ViewedScene {
    fn render(&self, bench: &Workbench) -> Result<View> {
        let Self { bounds, camera } = self;
        // With cascades the lens is chosen among all, without it is the only one.
        let lenses = if bounds.cascades > 1 { LensKind::ALL.into() } else { LensKind::among([camera]) };
        Renderer::new(&bench.field.with_rounds(bench.plan.rounds), &lenses)?.render(camera)
    }

    fn name(&self) -> String {
        format!("{} cascades, {:?}", self.bounds.cascades, self.camera.lens)
    }

    /// Compares with the reference.
    fn compare(&self, result: &mut CheckResult, bench: &Workbench) -> Result<View> {
        let (view, case) = (self.render(bench)?, self.name());
        let (colors, depths) = expected(bench, &self.bounds, &self.camera)?;
        result.holds((view.width, view.height) == SIZE, || format!("{case}: size"));
        let size = |i: usize| 1.0 + colors[i].abs();
        result.each(&format!("{case}, colour"), view.color.as_flattened(), &colors, size);
        result.each(&format!("{case}, depth"), &view.depth, &depths, |i| 1.0 + depths[i]);
        result.holds(depths.iter().any(|&z| z > 0.0), || format!("{case}: all is transparent"));
        Ok(view)
    }

    /// Rounds of one sample, of three, and of all that a ray has, in bands that end in the middle of a row.
    fn compare_rounds(&self, result: &mut CheckResult, bench: &mut Workbench, want: &View) -> Result<()> {
        let ordinary = bench.plan.rounds;
        let colors: Vec<f64> = want.color.as_flattened().iter().map(|&x| x.into()).collect();
        let depths: Vec<f64> = want.depth.iter().map(|&z| z.into()).collect();
        for (quota, rays, band) in [(1, 7, 50), (3, 64, 1000), (bench.plan.config.march.most_steps, 130, 98)]
        {
            bench.plan.rounds = Rounds { rays, samples: rays * quota, most_quota: quota, band, ..ordinary };
            let (view, case) = (self.render(bench)?, format!("{}, rounds of {quota}", self.name()));
            let size = |i: usize| 1.0 + colors[i].abs();
            result.each(&format!("{case}, colour"), view.color.as_flattened(), &colors, size);
            result.each(&format!("{case}, depth"), &view.depth, &depths, |i| 1.0 + depths[i]);
        }
        bench.plan.rounds = ordinary;
        Ok(())
    }
}

/// What the reference sees: colour and opacity `[pixels, 4]`, and depth.
fn expected(bench: &Workbench, bounds: &Bounds, camera: &Camera) -> Result<(Vec<f64>, Vec<f64>)> {
    let march = reference(bench);
    let words = vec![u32::MAX; bench.plan.cell_count() / 32];
    let (model, objective) = (bench.model()?, bench.objective());
    let side = 2.0 * bounds.outer_half();
    let (mut colors, mut depths) = (Vec::new(), Vec::new());
    for index in 0..SIZE.0 * SIZE.1 {
        let pixel = DVec2::new(f64::from(index % SIZE.0) + 0.5, f64::from(index / SIZE.0) + 0.5);
        let Some(ray) = camera.ray(pixel) else {
            colors.extend([0.0; 4]);
            depths.push(0.0);
            continue;
        };
        let in_box = BoxRay { origin: (ray.origin - bounds.min()) / side, direction: ray.direction };
        let (mut taus, mut values, mut z) = (Vec::new(), Vec::new(), Vec::new());
        for sample in march.samples(in_box, 0.5, &words) {
            if (-taus.iter().sum::<f64>()).exp() < STOP {
                break;
            }
            let (s, color) = model.query(objective.color_range, sample.position, ray.direction);
            taus.push(optical_depth(s, sample.delta));
            values.push(color);
            let seen = sample.position * side + bounds.min() - camera.position();
            z.push(lens::depth(&camera.lens, camera.world_from_camera.matrix3.transpose() * seen));
        }
        let weights: Vec<f64> = (transmittances(objective.transmittance, &taus).iter().zip(&taus))
            .map(|(t, &tau)| t * opacity(tau))
            .collect();
        let channel = |x: usize| weights.iter().zip(&values).map(|(w, c)| w * c[x]).sum::<f64>();
        colors.extend([channel(0), channel(1), channel(2), weights.iter().sum()]);
        depths.push(mean_depth(&weights, &z));
    }
    Ok((colors, depths))
}
