//! Whole training steps of a tiny field, through the trainer, on the samples that the device chose.

use super::check_result::largest;
use super::inputs::Random;
use super::{CheckResult, CheckedAdapter, Setup, Workbench};
use crate::camera::{Camera, Lens};
use crate::config::Transmittance;
use crate::config::{Background, Loss, Optimizer, Selection};
use crate::field::layout::DENSITY_OUTPUTS;
use crate::field::trainer::{StepStats, Trainer};
use crate::field::training_views::TrainingViews;
use crate::field::{Field, RayTarget, STEP_GROWTH, STEP_SHRINKAGE, SceneFeatures};
use crate::photo::Photo;
use crate::photo::{Image, Pixels};
use crate::verify::reference::activation::log_density;
use crate::verify::reference::adam::Adam;
use crate::verify::reference::composite::optical_depth;
use crate::verify::reference::model::{BatchOutput, Model, RaySample, TrainingRay};
use crate::verify::reference::step::ModelTraining;
use anyhow::Result;
use glam::{DAffine3, DMat3, DVec2, DVec3};

/// Learning rate of every step.
pub const LEARNING_RATE: f64 = 1e-2;

/// A trainer of a tiny field, and its buffers as a workbench.
#[derive(Debug)]
pub struct TinyTraining {
    /// The trainer.
    pub trainer: Trainer,
    /// Its buffers.
    pub bench: Workbench,
}

/// What is trained, by name: plain, over random backgrounds, in the inclusive convention, with linear light and a
/// relative loss in cascades, and with masks, depth,
/// distortion, sparsity and 16 bits.
#[must_use]
pub fn setups() -> [(&'static str, Setup); 5] {
    let mut random_background = Setup::tiny().network(32, 2);
    random_background.config.background = Background::Random;
    let cascades = Setup::tiny().network(32, 1).hdr(true).cascades(3);
    let mut masks = Setup::tiny();
    masks.config.loss = Loss { depth: 0.3, distortion: 0.02, sparsity: 0.01, ..Loss::default() };
    (masks.features.deep, masks.features.masks, masks.features.depth) = (true, true, true);
    [
        ("plain", Setup::tiny()),
        ("random background", random_background),
        ("inclusive", Setup::tiny().transmittance(Transmittance::Inclusive)),
        ("hdr, 3 cascades", cascades),
        ("masks, depth, distortion, sparsity, 16 bits", masks),
    ]
}

/// Loss, gradients and parameters of one step of each of `setups`.
///
/// # Errors
/// When the device was lost or refuses a kernel.
pub fn one_step(adapter: &CheckedAdapter, setups: &[(&str, Setup)]) -> Result<CheckResult> {
    let mut result = CheckResult::new(
        "one whole step",
        5e-6,
        "gradients of all kernels, relative to the largest of their kind",
    );
    for (name, setup) in setups {
        let mut tiny = TinyTraining::new(adapter, setup.clone())?;
        // Larger features than the initial ones, so that every gradient matters.
        tiny.bench.randomise(&mut Random::new(81), 0.5, 1.0)?;
        let mut reference = tiny.reference()?;
        let before = reference.model.clone();
        let (stats, batch) = tiny.step()?;
        let kept = |ray: &TrainingRay| ray.samples.iter().filter(|sample| sample.gains != [0.0; 2]).count();
        let samples: usize = batch.iter().map(kept).sum();
        let counted = [stats.steps, stats.skipped] == [1, 0]
            && stats.rays == batch.len() as u64
            && stats.samples == samples as u64;
        result.holds(counted, || format!("{name}: {stats:?}, {} rays, {samples} samples", batch.len()));
        let filled = batch.len() >= 16 && batch.iter().any(|ray| ray.samples.len() > 3);
        let thinned =
            reference.objective.transmittance == Transmittance::Inclusive || tiny.representatives()? > 3;
        result.holds(filled && thinned, || format!("{name}: a thin batch"));
        let want = reference.step(&batch, LEARNING_RATE);
        result.value(stats.loss, want.loss, want.loss, || format!("{name}: loss"));
        let error = color_error(&want);
        result.value(stats.color_error, error, error, || format!("{name}: colour error"));
        compare_rays(&mut result, name, &tiny.bench)?;
        compare_moments(&mut result, name, &tiny.bench, &reference)?;
        compare_parameters(&mut result, name, [&before, &tiny.bench.model()?], &reference, &want);
    }
    Ok(result)
}

/// Mean squared error of red, green and blue, as they count.
fn color_error(output: &BatchOutput) -> f64 {
    let sum: f64 = output.loss_terms.iter().flat_map(|terms| &terms[..3]).sum();
    sum / (3.0 * output.loss_terms.len() as f64)
}

/// The number of rays of the next step and the length of their steps, which follow how many samples this one's rays had.
fn compare_rays(result: &mut CheckResult, name: &str, bench: &Workbench) -> Result<()> {
    let counters = bench.counters()?;
    let batch = &bench.plan.config.batch;
    let asked = f64::from(batch.first_rays);
    let share = f64::from(counters.rays_used) / asked;
    let fit_kept = batch.kept as f64 / f64::from(counters.kept_wanted.max(1)) * share;
    let fit_samples = (batch.samples / 8 * 7) as f64 / f64::from(counters.samples_wanted.max(1));
    let want = (asked * fit_kept.min(fit_samples).clamp(0.5, 1.5)).clamp(16.0, batch.rays as f64);
    let got = f64::from(counters.rays);
    result.holds((got - want).abs() <= 1.0, || format!("{name}: {got} rays next instead of {want}"));
    let march = &bench.plan.config.march;
    let crowding = f64::from(counters.samples_wanted) / (asked * march.samples_per_ray);
    let scale = march.longest_step * crowding.clamp(STEP_SHRINKAGE, STEP_GROWTH);
    let scale = scale.clamp(1.0, march.longest_step);
    result.value(1.0 + f64::from(counters.step_excess), scale, scale, || format!("{name}: length of steps"));
    Ok(())
}

/// β1 = 0.9: the first moment is a tenth of the gradient.
fn compare_moments(
    result: &mut CheckResult,
    name: &str,
    bench: &Workbench,
    reference: &ModelTraining,
) -> Result<()> {
    let [first, _] = bench.table_moments()?;
    result.all(&format!("{name}: gradient of the table"), &first, &reference.table_moments.first);
    let moments = reference.density_moments.iter().chain(&reference.color_moments);
    for (layer, (got, want)) in bench.weights("mlp_first")?.iter().zip(moments).enumerate() {
        let used = got.get(..want.first.len()).unwrap_or(got);
        result.all(&format!("{name}: gradient of layer {layer}"), used, &want.first);
    }
    Ok(())
}

/// Adam's first step is the gradient's sign: only gradients well above rounding decide it.
fn compare_parameters(
    result: &mut CheckResult,
    name: &str,
    [before, now]: [&Model; 2],
    reference: &ModelTraining,
    want: &BatchOutput,
) {
    let mut compare = |part: &str, got: &[f64], want: &[f64], gradient: &[f64]| {
        let least = 1e-3 * largest(gradient);
        let clear = (0..gradient.len()).filter(|&i| gradient[i].abs() > least);
        clear.for_each(|i| {
            result.value(got[i], want[i], 1.0, || format!("{name}: {part} {i} after the step"));
        });
    };
    let (gradients, trained) = (&want.gradients, &reference.model);
    compare("table entry", &now.table, &trained.table, &gradients.table);
    for (part, now, then, gradients) in [
        ("weight of the density network", &now.density, &trained.density, &gradients.density),
        ("weight of the colour network", &now.color, &trained.color, &gradients.color),
    ] {
        for ((now, then), gradient) in now.layers.iter().zip(&then.layers).zip(gradients) {
            compare(part, &now.weights, &then.weights, gradient);
        }
    }
    let mut untouched = (0..before.table.len()).filter(|&i| gradients.table[i] == 0.0);
    let same = untouched.all(|i| before.table[i] == now.table[i]);
    result.holds(same, || format!("{name}: table entries that no sample touches"));
}

impl TinyTraining {
    /// A trainer on three small images.
    ///
    /// # Errors
    /// When the adapter cannot hold it or refuses a kernel.
    pub fn new(adapter: &CheckedAdapter, setup: Setup) -> Result<Self> {
        let mut setup = adapter.setup(setup);
        let cameras = cameras();
        setup.config.optimizer = Optimizer::default();
        // High enough that every batch has light samples, of which some are dropped.
        setup.config.selection = Selection { weight_floor: 0.05, light_share: 0.5, stop_transmittance: 1e-4 };
        (setup.config.march.longest_step, setup.config.march.samples_per_ray) = (1.5, 20.0);
        setup.config.batch.kept = 1024;
        setup.config.batch.samples = 4096;
        let mut random = Random::new(80);
        let photos: Vec<_> =
            cameras.iter().map(|camera| photo(&mut random, camera, &setup.features)).collect();
        let plan = setup.plan(&adapter.gpu)?;
        let mut views = TrainingViews::new(&adapter.gpu, &plan, &cameras)?;
        photos.iter().try_for_each(|photo| views.add(photo))?;
        let trainer = Trainer::new(Field::new(&adapter.gpu, plan)?, views)?;
        let bench = Workbench::of(trainer.field().clone(), trainer.workspace().clone())?;
        Ok(Self { trainer, bench })
    }

    /// The reference, with the parameters that are on the device.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn reference(&self) -> Result<ModelTraining> {
        let config = &self.bench.plan.config.optimizer;
        let mut training = ModelTraining::new(self.bench.model()?, self.bench.objective());
        let constants = |l2, skip_zero| Adam {
            beta1: config.beta_1,
            beta2: config.beta_2,
            epsilon: config.epsilon,
            l2,
            skip_zero,
        };
        training.table_adam = constants(0.0, true);
        training.mlp_adam = constants(config.l2, false);
        Ok(training)
    }

    /// One step; what the trainer reports of it, and the batch that it used.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn step(&mut self) -> Result<(StepStats, Vec<TrainingRay>)> {
        self.trainer.step(LEARNING_RATE, None)?;
        Ok((self.trainer.report()?, self.batch()?))
    }

    /// How many of the last step's kept samples stand for others too, in one estimate only.
    fn representatives(&self) -> Result<usize> {
        let kept = self.bench.kept(self.bench.counters()?.kept as usize)?;
        Ok(kept.iter().filter(|kept| kept.gains[0] > 1.01 && kept.gains[1] == 0.0).count())
    }

    /// The samples of the last step up to where each ray ends, its targets and backgrounds.
    fn batch(&self) -> Result<Vec<TrainingRay>> {
        let bench = &self.bench;
        let counters = bench.counters()?;
        let rays = counters.rays_used as usize;
        let samples: Vec<[f32; 4]> = bench.read("samples", counters.samples as usize)?;
        let mut gains = vec![[0.0; 2]; samples.len()];
        for kept in bench.kept(counters.kept as usize)? {
            gains[kept.sample as usize] = kept.gains.map(f64::from);
        }
        let density = bench.density(samples.len())?;
        let spans: Vec<[u32; 2]> = bench.read("ray_spans", rays)?;
        let directions = bench.rays(rays)?;
        let targets: Vec<RayTarget> = bench.read("ray_targets", rays)?;
        let scale = bench.plan.space.cubes_per_box();
        let vector = |x: &[f32; 4]| DVec3::new(f64::from(x[0]), f64::from(x[1]), f64::from(x[2]));
        let sample = |index: usize, ray: usize| {
            let position = vector(&samples[index]);
            let [origin, direction] = directions[ray].each_ref().map(vector);
            let distance = (position - origin).dot(direction) * scale;
            RaySample { position, delta: f64::from(samples[index][3]), gains: gains[index], distance }
        };
        let stop = bench.plan.config.selection.stop_transmittance;
        let of_ray = |ray: usize| -> Vec<RaySample> {
            let [first, count] = spans[ray].map(|x| x as usize);
            let mut before = 0.0;
            (first..first + count)
                .take_while(|&index| {
                    let is_reached = f64::exp(-before) >= stop;
                    let s = log_density(f64::from(density[index * DENSITY_OUTPUTS]));
                    before += optical_depth(s, f64::from(samples[index][3]));
                    is_reached
                })
                .map(|index| sample(index, ray))
                .collect()
        };
        Ok((0..rays)
            .map(|ray| TrainingRay {
                direction: vector(&directions[ray][1]),
                samples: of_ray(ray),
                target: targets[ray].color.map(f64::from),
                background: targets[ray].background.map(f64::from),
                depth: f64::from(targets[ray].depth),
            })
            .collect())
    }
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

/// About one colour with a little noise: something that a tiny field can learn. Some pixels are ignored, and of some
/// the depth is not known.
fn photo(random: &mut Random, camera: &Camera, features: &SceneFeatures) -> Photo {
    let count = camera.width * camera.height;
    let pixels = if features.hdr {
        let pixel = |_| [4.0, 2.5, 0.5, 0.9].map(|x| (x * random.number(0.8, 1.0)) as f32);
        Pixels::Linear((0..count).map(pixel).collect())
    } else if features.deep {
        let pixel = |_| [65_000.0, 40_000.0, 5_000.0, 60_000.0].map(|x| (x * random.number(0.8, 1.0)) as u16);
        Pixels::Srgb16((0..count).map(pixel).collect())
    } else {
        let pixel = |_| [250.0, 150.0, 20.0, 230.0].map(|x| (x * random.number(0.8, 1.0)) as u8);
        Pixels::Srgb8((0..count).map(pixel).collect())
    };
    let image = Image { width: camera.width, height: camera.height, pixels, has_alpha: true };
    let mut photo = Photo::from(image);
    if features.masks {
        photo.ignored = (0..count).map(|pixel| pixel % 3 == 0).collect();
    }
    if features.depth {
        let depth = |pixel| if pixel % 5 == 0 { 0.0 } else { random.number(1.0, 2.0) as f32 };
        photo.depth = (0..count).map(depth).collect();
    }
    photo
}
