//! Whole training steps of a tiny field, through the trainer, against the reference on the same samples.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec2, DVec3};
use nerf::camera::{Camera, Lens};
use nerf::check::Workbench;
use nerf::config::{Background, Optimizer, Selection};
use nerf::dataset::Bounds;
use nerf::image::{Image, Pixels};
use nerf::reference::adam::Adam;
use nerf::reference::model::{RaySample, TrainingRay};
use nerf::reference::step::Training;
use nerf::train::{Trainer, Views};

use crate::bench::{Bench, Random, Setup, open};
use crate::close::{assert_close, assert_close_to_scale, largest};

const LEARNING_RATE: f64 = 1e-2;

/// A trainer, and its buffers as a bench.
struct Tiny {
    trainer: Trainer,
    bench: Bench,
}

/// Cameras of different sizes around the unit cube that look at its centre.
fn cameras() -> Vec<Camera> {
    let eyes = [DVec3::new(2.0, 0.3, 0.4), DVec3::new(0.3, -1.2, 0.8), DVec3::new(0.6, 0.7, 2.1)];
    let sizes = [(13, 9), (8, 8), (5, 11)];
    (eyes.into_iter().zip(sizes))
        .map(|(eye, (width, height))| {
            let back = (eye - DVec3::splat(0.5)).normalize();
            let right = back.any_orthonormal_vector();
            let matrix = DMat3::from_cols(right, back.cross(right), back);
            Camera {
                width,
                height,
                focal_px: DVec2::splat(1.2 * f64::from(width)),
                center_px: DVec2::new(f64::from(width), f64::from(height)) / 2.0,
                lens: Lens::Pinhole,
                world_from_camera: DAffine3::from_mat3_translation(matrix, eye),
            }
        })
        .collect()
}

/// About one colour with a little noise: something that a tiny field can learn.
fn image(random: &mut Random, camera: &Camera, hdr: bool) -> Image {
    let count = camera.width * camera.height;
    let pixels = if hdr {
        let pixel = |_| [4.0, 2.5, 0.5, 0.9].map(|x| (x * random.number(0.8, 1.0)) as f32);
        Pixels::Linear((0..count).map(pixel).collect())
    } else {
        let pixel = |_| [250.0, 150.0, 20.0, 230.0].map(|x| (x * random.number(0.8, 1.0)) as u8);
        Pixels::Srgb8((0..count).map(pixel).collect())
    };
    Image { width: camera.width, height: camera.height, pixels, has_alpha: true }
}

impl Tiny {
    fn new(mut setup: Setup) -> Self {
        let cameras = cameras();
        setup.needs.cameras = cameras.len();
        setup.config.optimizer = Optimizer::default();
        // High enough that every batch has light samples, of which some are dropped.
        setup.config.selection =
            Selection { weight_floor: 0.05, keep_probability: 0.5, stop_transmittance: 1e-4 };
        setup.config.batch.kept = 1024;
        setup.config.batch.samples = 4096;
        let mut random = Random::new(80);
        let images: Vec<Image> =
            cameras.iter().map(|camera| image(&mut random, camera, setup.needs.hdr)).collect();
        let cascades = setup.needs.cascades;
        let bounds = Bounds { center: DVec3::splat(0.5), half: 0.5, cascades, source: String::new() };
        let gpu = Arc::new(open());
        let plan = setup.plan(&gpu).expect("a valid configuration");
        let views = Views { cameras: &cameras, images: &images, bounds: &bounds };
        let trainer = Trainer::new(&gpu, plan.clone(), &views).expect("a trainer");
        let bench = Bench(Workbench { gpu, plan, workspace: trainer.workspace().clone() });
        Self { trainer, bench }
    }

    fn reference(&self) -> Training {
        let config = &self.bench.plan.config.optimizer;
        let mut training = Training::new(self.bench.model(), self.bench.objective());
        let constants = |l2, skip_zero| Adam {
            beta1: config.beta_1,
            beta2: config.beta_2,
            epsilon: config.epsilon,
            l2,
            skip_zero,
        };
        training.table_adam = constants(0.0, true);
        training.mlp_adam = constants(config.l2, false);
        training
    }

    /// One step; its loss, and the batch that it used.
    fn step(&mut self) -> (f64, Vec<TrainingRay>) {
        self.trainer.step(LEARNING_RATE, None).expect("a step");
        let stats = self.trainer.report().expect("a report");
        assert_eq!(stats.steps, 1);
        let batch = self.batch();
        assert_eq!(stats.rays as usize, batch.len());
        assert_eq!(stats.samples as usize, batch.iter().map(|ray| ray.samples.len()).sum::<usize>());
        (stats.loss, batch)
    }

    /// How many of the last step's kept samples stand for others too.
    fn lengthened(&self) -> usize {
        let counters = self.bench.counters();
        let samples: Vec<[f32; 4]> = self.bench.read("samples", counters.samples as usize);
        let kept = self.bench.kept(counters.kept as usize);
        kept.iter().filter(|kept| kept.delta > 1.01 * samples[kept.sample as usize][3]).count()
    }

    /// The kept samples of the last step, its targets and backgrounds.
    fn batch(&self) -> Vec<TrainingRay> {
        let bench = &self.bench;
        let counters = bench.counters();
        let (rays, kept) = (counters.rays_used as usize, counters.kept as usize);
        let samples: Vec<[f32; 4]> = bench.read("samples", counters.samples as usize);
        let kept = bench.kept(kept);
        let spans: Vec<[u32; 2]> = bench.read("kept_spans", rays);
        let directions = bench.rays(rays);
        let targets: Vec<[f32; 4]> = bench.read("targets", rays);
        let backgrounds: Vec<[f32; 4]> = bench.read("backgrounds", rays);
        let vector = |x: &[f32]| DVec3::new(f64::from(x[0]), f64::from(x[1]), f64::from(x[2]));
        (0..rays)
            .map(|ray| TrainingRay {
                direction: vector(&directions[ray][1]),
                samples: (spans[ray][0]..spans[ray][0] + spans[ray][1])
                    .map(|row| {
                        let kept = &kept[row as usize];
                        RaySample {
                            position: vector(&samples[kept.sample as usize]),
                            delta: f64::from(kept.delta),
                            gain: 1.0,
                        }
                    })
                    .collect(),
                target: targets[ray].map(f64::from),
                background: vector(&backgrounds[ray]).to_array(),
            })
            .collect()
    }
}

fn setups() -> Vec<(&'static str, Setup)> {
    let mut random_background = Setup::tiny().network(32, 2);
    random_background.config.background = Background::Random;
    let inclusive = Setup::tiny().transmittance(nerf::reference::Transmittance::Inclusive);
    let mut cascades = Setup::tiny().network(32, 1).hdr(true);
    cascades.needs.cascades = 3;
    vec![
        ("plain", Setup::tiny()),
        ("random background", random_background),
        ("inclusive", inclusive),
        ("hdr, 3 cascades", cascades),
    ]
}

#[test]
fn one_step_agrees_with_the_reference() {
    for (name, setup) in setups() {
        let mut tiny = Tiny::new(setup);
        // Larger features than the initial ones, so that every gradient matters.
        tiny.bench.randomise(&mut Random::new(81), 0.5, 1.0);
        let mut reference = tiny.reference();
        let before = reference.model.clone();
        let (loss, batch) = tiny.step();
        assert!(batch.len() >= 16 && batch.iter().any(|ray| ray.samples.len() > 3), "{name}: a thin batch");
        let lengthened = tiny.lengthened();
        assert!(lengthened > 3, "{name}: {lengthened} samples stand for others");
        let want = reference.step(&batch, LEARNING_RATE);
        assert_close(&format!("loss, {name}"), &[loss], &[want.loss], 0.0, 1e-5);

        // β1 = 0.9: the first moment is a tenth of the gradient.
        let [got, _] = tiny.bench.table_moments();
        let first = &reference.table_moments.first;
        assert_close(&format!("d_table, {name}"), &got, first, 5e-5 * largest(first), 0.0);
        let moments = reference.density_moments.iter().chain(&reference.color_moments);
        for (number, (got, want)) in tiny.bench.weights("mlp_first").iter().zip(moments).enumerate() {
            let got = &got[..want.first.len()];
            assert_close_to_scale(&format!("d_weights {number}, {name}"), got, &want.first, 5e-5);
        }

        // Adam's first step is the gradient's sign: only gradients well above rounding decide it.
        let clear = |gradient: &[f64]| {
            let least = 1e-3 * largest(gradient);
            (0..gradient.len()).filter(move |&i| gradient[i].abs() > least).collect::<Vec<_>>()
        };
        let pick = |values: &[f64], indices: &[usize]| indices.iter().map(|&i| values[i]).collect::<Vec<_>>();
        let now = tiny.bench.model();
        let compare = |part: &str, got: &[f64], want: &[f64], gradient: &[f64]| {
            let indices = clear(gradient);
            assert!(!indices.is_empty());
            let name = format!("{part} after a step, {name}");
            assert_close(&name, &pick(got, &indices), &pick(want, &indices), 1e-6, 0.0);
        };
        compare("table", &now.table, &reference.model.table, &want.gradients.table);
        for (number, gradient) in want.gradients.color.iter().enumerate() {
            let [now, then] = [&now.color, &reference.model.color].map(|mlp| &mlp.layers[number].weights);
            compare(&format!("color {number}"), now, then, gradient);
        }
        for (number, gradient) in want.gradients.density.iter().enumerate() {
            let [now, then] = [&now.density, &reference.model.density].map(|mlp| &mlp.layers[number].weights);
            compare(&format!("density {number}"), now, then, gradient);
        }
        // What no sample touches stays to the last bit.
        let untouched = (0..before.table.len()).filter(|&i| want.gradients.table[i] == 0.0);
        assert!(untouched.clone().count() > 0);
        assert!(untouched.into_iter().all(|i| before.table[i] == now.table[i]));
    }
}

/// Both train on the samples that the device chose; the losses stay together while Adam amplifies rounding.
#[test]
fn twenty_losses_agree_with_the_reference() {
    for (name, setup) in setups() {
        let mut tiny = Tiny::new(setup);
        let mut reference = tiny.reference();
        let (mut got, mut want) = (Vec::new(), Vec::new());
        for _ in 0..20 {
            let (loss, batch) = tiny.step();
            got.push(loss);
            want.push(reference.step(&batch, LEARNING_RATE).loss);
        }
        println!("{name}: loss {:.4} to {:.4}, reference {:.4}", got[0], got[19], want[19]);
        assert_close(&format!("20 losses, {name}"), &got, &want, 0.0, 2e-4);
        let sum = |losses: &[f64]| losses.iter().sum::<f64>();
        assert!(sum(&want[15..]) < 0.8 * sum(&want[..5]), "{name}: {want:?}");
    }
}

/// Starting over, and going on from a state, repeat the same steps.
#[test]
fn states_are_restored() {
    let mut tiny = Tiny::new(Setup::tiny());
    tiny.trainer.warm_up().expect("a warm-up");
    let losses = |tiny: &mut Tiny, steps: usize| (0..steps).map(|_| tiny.step().0).collect::<Vec<_>>();
    let first = losses(&mut tiny, 5);
    let state = tiny.trainer.state().expect("a state");
    let rest = losses(&mut tiny, 15);
    tiny.trainer.restore(&state).expect("a restored state");
    assert_eq!(tiny.trainer.steps(), 5);
    assert_eq!(tiny.trainer.state().expect("a state"), state);
    // Float atomics add in any order.
    assert_close("losses after a restore", &losses(&mut tiny, 15), &rest, 0.0, 1e-3);
    tiny.trainer.reset().expect("a reset");
    assert_close("losses after a reset", &losses(&mut tiny, 5), &first, 0.0, 1e-3);
}
