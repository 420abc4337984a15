//! Training runs that would break a careless trainer: each guard has a test that fails without it.

use glam::{DAffine3, DMat3, DVec2, DVec3};
use nerf::camera::Bounds;
use nerf::camera::{Camera, Lens, LensKind};
use nerf::config::{Accumulation, Batch, ColorLoss, Config, Grid, March, Network, Occupancy};
use nerf::field::renderer::{Renderer, View};
use nerf::field::state::State;
use nerf::field::trainer::{StepStats, Trainer};
use nerf::field::training_views::TrainingViews;
use nerf::field::{Counters, Field, Plan, SceneFeatures, Space};
use nerf::gpu::buffer_spec::BufferSpec;
use nerf::gpu::{Gpu, adapter};
use nerf::photo::{Image, Pixels};
use std::sync::Arc;

const LEARNING_RATE: f64 = 1e-2;

/// What is trained on: cameras around the origin of the world, and a pixel that all their images are full of.
struct Scene {
    size: u32,
    views: usize,
    /// World units per unit of the standard scene.
    scale: f64,
    /// So many of the cameras look away from the origin.
    away: usize,
    image: fn(u32, u32) -> Pixels,
    has_alpha: bool,
}

impl Default for Scene {
    fn default() -> Self {
        Self { size: 12, views: 6, scale: 1.0, away: 0, image: disc, has_alpha: true }
    }
}

/// An opaque orange disc on nothing.
fn disc(width: u32, height: u32) -> Pixels {
    let center = DVec2::new(f64::from(width), f64::from(height)) / 2.0;
    let pixel = |i: u32| {
        let at = DVec2::new(f64::from(i % width), f64::from(i / width)) + 0.5;
        if at.distance(center) < 0.3 * f64::from(width) { [250, 140, 20, 255] } else { [0; 4] }
    };
    Pixels::Srgb8((0..width * height).map(pixel).collect())
}

fn solid(pixel: [u8; 4], width: u32, height: u32) -> Pixels {
    Pixels::Srgb8(vec![pixel; (width * height) as usize])
}

fn linear(pixel: [f32; 4], width: u32, height: u32) -> Pixels {
    Pixels::Linear(vec![pixel; (width * height) as usize])
}

impl Scene {
    fn cameras(&self) -> Vec<Camera> {
        let camera = |number: usize| {
            let angle = number as f64 * 2.4;
            let eye = DVec3::new(angle.cos() * 3.0, angle.sin() * 3.0, 0.4 + 0.5 * (number % 3) as f64);
            let back = eye.normalize() * if number < self.away { -1.0 } else { 1.0 };
            let right = back.any_orthonormal_vector();
            let matrix = DMat3::from_cols(right, back.cross(right), back);
            Camera {
                width: self.size,
                height: self.size,
                focal_px: DVec2::splat(1.4 * f64::from(self.size)),
                center_px: DVec2::splat(f64::from(self.size) / 2.0),
                lens: Lens::Pinhole,
                world_from_camera: DAffine3::from_mat3_translation(matrix, eye * self.scale),
            }
        };
        (0..self.views).map(camera).collect()
    }

    fn images(&self) -> Vec<Image> {
        let image = |_| {
            let pixels = (self.image)(self.size, self.size);
            Image { width: self.size, height: self.size, pixels, has_alpha: self.has_alpha }
        };
        (0..self.views).map(image).collect()
    }

    fn bounds(&self) -> Bounds {
        Bounds { center: DVec3::ZERO, half: self.scale, cascades: 1, source: String::new(), is_guess: false }
    }

    fn train(&self) -> Training {
        self.train_with(config())
    }

    fn train_with(&self, config: Config) -> Training {
        config.validate().expect("a valid configuration");
        let choice = std::env::var("NERF_ADAPTER").ok();
        let adapter = adapter::choose(choice.as_deref()).expect("an adapter");
        let gpu = Arc::new(Gpu::open(&adapter).expect("it opens"));
        let (cameras, images, bounds) = (self.cameras(), self.images(), self.bounds());
        let features = SceneFeatures {
            lenses: LensKind::among(&cameras),
            alpha: self.has_alpha,
            hdr: images.iter().any(Image::is_hdr),
            ..SceneFeatures::default()
        };
        let plan = Plan::new(&gpu, config, features, Space::from(&bounds));
        let mut views = TrainingViews::new(&gpu, &plan, &cameras).expect("room");
        images.into_iter().for_each(|image| views.add(&image.into()).expect("its photo"));
        let trainer = Trainer::new(Field::new(&gpu, plan).expect("a field"), views).expect("a trainer");
        Training { trainer, gpu, camera: cameras[0].clone() }
    }
}

fn config() -> Config {
    Config {
        grid: Grid { levels: 8, base: 8, finest: 64, log2_table: 10 },
        network: Network { width: 16, color_layers: 1 },
        march: March { steps: 64, most_steps: 128, ..March::default() },
        occupancy: Occupancy { cells: 16, ..Occupancy::default() },
        batch: Batch { kept: 2048, samples: 8192, rays: 2048, first_rays: 128 },
        ..Config::default()
    }
}

struct Training {
    trainer: Trainer,
    gpu: Arc<Gpu>,
    camera: Camera,
}

impl Training {
    fn steps(&mut self, count: u32) -> StepStats {
        self.steps_at(count, LEARNING_RATE)
    }

    fn steps_at(&mut self, count: u32, learning_rate: f64) -> StepStats {
        for _ in 0..count {
            self.trainer.step(learning_rate, None).expect("a step");
        }
        self.trainer.report().expect("a report")
    }

    /// The state, every number of which is finite.
    #[track_caller]
    fn finite_state(&self) -> State {
        let state = self.trainer.state().expect("a state");
        for (name, numbers) in &state.arrays {
            let values = numbers.floats();
            let bad = values.iter().filter(|value| !value.is_finite()).count();
            assert_eq!(bad, 0, "{bad} of {} values of '{name}' are not finite", values.len());
        }
        state
    }

    /// The first training view, every pixel of which is finite.
    #[track_caller]
    fn finite_view(&self) -> View {
        let field = self.trainer.field();
        let mut renderer = Renderer::new(field, &field.plan().features.lenses).expect("a renderer");
        let view = renderer.render(&self.camera).expect("a view");
        assert!(view.color.as_flattened().iter().chain(&view.depth).all(|value| value.is_finite()));
        view
    }

    /// Trains and looks for anything that is not finite; returns the report of the last steps.
    #[track_caller]
    fn survives(mut self, steps: u32) -> StepStats {
        let first = self.steps(steps - steps / 4);
        let last = self.steps(steps / 4);
        assert!(first.loss.is_finite() && last.loss.is_finite(), "{first:?} {last:?}");
        assert_eq!(first.skipped + last.skipped, 0, "skipped steps");
        self.finite_state();
        self.finite_view();
        last
    }

    /// A field whose log-density is about `weight` times a positive number, the same everywhere.
    fn set_density(&mut self, weight: f32) {
        let mut state = self.trainer.state().expect("a state");
        state.floats_mut("table").fill(1.0);
        let layer = self.trainer.plan().layout.density[1];
        for input in 0..layer.inputs {
            state.floats_mut("mlp")[layer.index(0, input)] = weight;
        }
        self.trainer.restore(&state).expect("restored");
    }
}

/// exp of a raw output would be infinite, or 0 for all samples of all rays.
#[test]
fn log_densities_beyond_the_exponent() {
    for weight in [1e4, -1e4] {
        let mut training = Scene::default().train();
        training.set_density(weight);
        let view = training.finite_view();
        let opaque = view.color.iter().filter(|pixel| pixel[3] > 0.999).count();
        assert_eq!(opaque > 0, weight > 0.0);
        training.survives(20);
    }
}

/// Where nothing is opaque no density has much of a gradient. The decay of the weights brings it back, Adam does not
/// care how small a gradient is, and cells are occupied relative to the mean.
#[test]
fn an_empty_start_recovers() {
    let mut training = Scene::default().train();
    training.set_density(-3.0);
    let first = training.steps(10);
    assert!(training.finite_view().color.iter().all(|pixel| pixel[3] < 1e-3), "it was meant to be empty");
    let last = training.survives(160);
    assert!(last.loss < 0.5 * first.loss, "{first:?} {last:?}");
}

/// Behind an opaque front no density has a gradient: it dissolves from the front.
#[test]
fn an_opaque_start_recovers() {
    let mut training = Scene::default().train();
    training.set_density(0.5);
    let first = training.steps(10);
    assert!(training.finite_view().color.iter().any(|pixel| pixel[3] > 0.999), "it was meant to be opaque");
    let last = training.survives(600);
    assert!(last.loss < 0.5 * first.loss, "{first:?} {last:?}");
}

/// Photos of one colour, and of nothing at all.
#[test]
fn uniform_photos() {
    let scene = |image, has_alpha| Scene { image, has_alpha, ..Scene::default() };
    let white = scene(|w, h| solid([255; 4], w, h), false).train().survives(150);
    assert!(white.loss < 0.05, "white: {white:?}");
    let black = scene(|w, h| solid([0, 0, 0, 255], w, h), false).train().survives(150);
    assert!(black.loss < 0.05, "black: {black:?}");
    let nothing = scene(|w, h| solid([0; 4], w, h), true).train().survives(40);
    assert!(nothing.loss < 1e-4, "nothing: {nothing:?}");
    let glass = scene(|w, h| solid([255, 255, 255, 0], w, h), true).train().survives(40);
    assert!(glass.loss < 1e-4, "white but transparent: {glass:?}");
}

#[test]
fn a_single_photo_and_photos_of_one_pixel() {
    let single = Scene { views: 1, ..Scene::default() }.train().survives(100);
    assert!(single.loss < 0.1, "{single:?}");
    let pixel = |w, h| solid([200, 100, 50, 255], w, h);
    for (size, views) in [(1, 6), (1, 1), (2, 3)] {
        let tiny = Scene { size, views, image: pixel, has_alpha: false, ..Scene::default() };
        let stats = tiny.train().survives(100);
        assert!(stats.loss < 0.1, "{size} {views}: {stats:?}");
    }
}

/// Ten decades between the channels; errors count relative to them.
#[test]
fn targets_of_high_dynamic_range() {
    let scene = |image| Scene { image, has_alpha: false, ..Scene::default() };
    let bright = scene(|w, h| linear([1e5, 3e4, 1e-5, 1.0], w, h)).train().survives(200);
    assert!(bright.loss < 50.0, "{bright:?}");
    // Integers hold the same gradients: their scale follows the largest.
    let config = Config { accumulation: Accumulation::Fixed, ..config() };
    let image = |w, h| linear([1e5, 3e4, 1e-5, 1.0], w, h);
    let integers = scene(image).train_with(config).survives(200);
    assert!((integers.loss / bright.loss - 1.0).abs() < 0.1, "{integers:?} {bright:?}");
    let dim = scene(|w, h| linear([1e-5, 1e-6, 0.0, 1.0], w, h)).train().survives(200);
    assert!(dim.loss < 0.01, "{dim:?}");
}

#[test]
fn scenes_of_any_scale() {
    let train = |scale| Scene { scale, ..Scene::default() }.train().survives(100);
    let standard = train(1.0);
    for scale in [1e-4, 1e6] {
        let scaled = train(scale);
        assert!((scaled.loss / standard.loss - 1.0).abs() < 0.2, "{scale}: {scaled:?} {standard:?}");
    }
}

/// Cameras that look away see nothing of the box: no sample lies outside of it, and a step without any is a step.
#[test]
fn rays_that_miss_the_box() {
    let mut config = config();
    config.batch.first_rays = 2048;
    let image = |w, h| solid([200, 100, 50, 255], w, h);
    let scene = |away| Scene { away, image, has_alpha: false, ..Scene::default() };
    let mut all = scene(6).train_with(config.clone());
    let stats = all.steps(20);
    assert!(stats.rays > 20_000 && stats.samples == 0, "{stats:?}");
    all.survives(20);
    let mut half = scene(3).train_with(config);
    half.steps(20);
    let workspace = half.trainer.workspace();
    let counters: Counters = workspace.read(&half.gpu, "counters", 1).expect("counters")[0];
    let samples: Vec<[f32; 4]> =
        workspace.read(&half.gpu, "samples", counters.samples as usize).expect("samples");
    let is_inside = |sample: &[f32; 4]| sample[..3].iter().all(|x| (-1e-4..1.0001).contains(x));
    assert!(samples.len() > 1000 && samples.iter().all(is_inside));
    half.survives(20);
}

/// The first rays ask for far more samples than there is room for: those that do not fit are left out.
#[test]
fn more_samples_than_fit() {
    let mut config = config();
    config.batch = Batch { kept: 512, samples: 1024, rays: 16_384, first_rays: 16_384 };
    config.march.longest_step = 1.0;
    let mut training = Scene::default().train_with(config.clone());
    let first = training.steps(1);
    assert!(first.rays < 100 && first.marched <= 1024 && first.samples <= 768, "{first:?}");
    let last = training.survives(200);
    assert!(last.loss < 0.7 * first.loss, "{first:?} {last:?}");
    // Not even one ray fits where it has more samples than the batch.
    config.batch.samples = 128;
    config.batch.kept = 128;
    Scene::default().train_with(config).survives(20);
}

/// One pixel of many is beyond all bounds: steps that draw it change nothing and are counted.
#[test]
fn steps_without_finite_gradients_are_skipped() {
    let image = |width: u32, height: u32| {
        let mut pixels = vec![[0.4, 0.2, 0.1, 1.0]; (width * height) as usize];
        pixels[0] = [3e38, 1.0, 1.0, 1.0];
        Pixels::Linear(pixels)
    };
    let mut config = config();
    config.batch = Batch { kept: 256, samples: 1024, rays: 64, first_rays: 16 };
    // Relative errors stay finite.
    config.loss.color = ColorLoss::Squared;
    let mut training = Scene { image, has_alpha: false, ..Scene::default() }.train_with(config);
    let (mut skipped, mut steps) = (0, 0);
    for _ in 0..100 {
        let before = training.finite_state();
        let stats = training.steps(1);
        assert!(stats.loss.is_finite(), "{stats:?}");
        let after = training.finite_state();
        if stats.skipped == 1 {
            for name in ["table", "table_moments", "mlp", "mlp_first", "mlp_second"] {
                assert!(before.floats(name) == after.floats(name), "'{name}' changed");
            }
        } else {
            assert!(before.floats("mlp") != after.floats("mlp"));
        }
        skipped += stats.skipped;
        steps += stats.steps;
    }
    assert!(skipped > 5 && skipped < 95 && steps == 100, "{skipped} of {steps} steps were skipped");
}

/// A software driver ends long loops without an error; ordered sums have a round per kept sample.
#[test]
fn batches_too_long_for_ordered_sums() {
    for (kept, is_short) in [(1 << 14, true), (1 << 16, false)] {
        let mut config = Config { accumulation: Accumulation::Ordered, ..config() };
        config.batch = Batch { kept, samples: 1 << 17, rays: 1 << 12, first_rays: 64 };
        let training = Scene::default().train_with(config);
        let (chosen, orders) = (training.trainer.plan().accumulation, is_short || !training.gpu.is_cpu());
        assert!(
            if orders { chosen == Accumulation::Ordered } else { chosen.is_of_integers() },
            "{kept}: {chosen:?}"
        );
        training.survives(4);
    }
}

/// A field, its photos and its renderer that do not go together are refused with what was found.
#[test]
fn parts_that_do_not_fit_are_refused() {
    let training = Scene::default().train();
    let (field, gpu) = (training.trainer.field(), &training.gpu);
    let refusal = |error: anyhow::Error| format!("{error:#}");
    let renderer = Renderer::new(field, &[].into()).map(drop);
    assert!(refusal(renderer.expect_err("no lens")).contains("lenses"));
    let views = |plan: &Plan| {
        let cameras = Scene::default().cameras();
        let mut views = TrainingViews::new(gpu, plan, &cameras).expect("room");
        Scene::default().images().into_iter().for_each(|image| views.add(&image.into()).expect("its photo"));
        views
    };
    let masked = SceneFeatures { masks: true, ..field.plan().features.clone() };
    let masked = Plan { features: masked, ..field.plan().clone() };
    let mixed = Trainer::new(Field::new(gpu, masked).expect("a field"), views(field.plan()));
    assert!(refusal(mixed.map(drop).expect_err("another plan")).contains("another plan"));
}

/// Views in the memory of the steps show what others show, and leave no trace in the training.
#[test]
fn views_between_steps_change_nothing() {
    let batch = Batch { kept: 32_768, samples: 65_536, rays: 8192, first_rays: 128 };
    let trained = |every: u32| {
        let mut training =
            Scene::default().train_with(Config { batch: batch.clone(), deterministic: true, ..config() });
        let plan = training.trainer.plan();
        let alone = plan.for_views(&plan.features.lenses).viewing_buffers();
        let alone: u64 = alone.iter().map(BufferSpec::bytes).sum();
        let besides = Renderer::bytes_besides(plan);
        assert!(!training.gpu.is_cpu() || besides < alone / 5 * 3, "{besides} of {alone} bytes");
        let mut renderer = training.trainer.renderer(&plan.features.lenses).expect("a renderer");
        for _ in 0..40 / every {
            training.steps(every);
            assert!(renderer.render(&training.camera).expect("a view") == training.finite_view());
        }
        training.finite_state()
    };
    assert!(trained(5) == trained(40));
}
