//! The kernels from selection to compositing, on rays whose densities and colours are given.

use super::medium::Samples;
use anyhow::{Context, Result, ensure};
use glam::DVec3;
use nerf::config::Config;
use nerf::config::Transmittance;
use nerf::field::{Plan, color, composite};
use nerf::gpu::Gpu;
use nerf::gpu::pass::Stage;
use nerf::gpu::timer::Timer;
use nerf::verify::check::{Setup, Workbench};
use nerf::verify::reference::model::{RaySample, TrainingRay};
use std::sync::Arc;

/// The transmittance of the early stop, that of a training run.
pub(crate) const STOP: f64 = 1e-4;
/// Samples on the device at once: about 700 bytes each, and on a GPU enough to fill it.
const SAMPLES_ON_CPU: usize = 1 << 18;
const SAMPLES_ON_GPU: usize = 1 << 20;
/// The stages between densities and colours.
const SELECTING: [&str; 4] = ["opacities", "select", "scan kept", "kept"];

/// A way to composite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Variant {
    /// The convention.
    pub(crate) transmittance: Transmittance,
    /// Whether a ray ends where its transmittance falls below [`STOP`].
    pub(crate) early_stop: bool,
}

impl Variant {
    /// All of them.
    pub(crate) const ALL: [Self; 4] = [
        Self { transmittance: Transmittance::Exclusive, early_stop: false },
        Self { transmittance: Transmittance::Inclusive, early_stop: false },
        Self { transmittance: Transmittance::Exclusive, early_stop: true },
        Self { transmittance: Transmittance::Inclusive, early_stop: true },
    ];

    /// The transmittance below which a ray ends.
    pub(crate) fn stop(self) -> f64 {
        if self.early_stop { STOP } else { 0.0 }
    }
}

/// The convention's name in tables and files.
pub(crate) fn name(transmittance: Transmittance) -> &'static str {
    match transmittance {
        Transmittance::Exclusive => "exclusive",
        Transmittance::Inclusive => "inclusive",
    }
}

/// What a chunk of rays came to.
pub(crate) struct Outcome {
    /// Colour and opacity of each ray.
    pub(crate) rendered: Vec<[f64; 4]>,
    /// Samples that were composited.
    pub(crate) kept: usize,
    /// Median of the repeats; `None` without timestamps.
    pub(crate) seconds: Option<f64>,
}

/// A workbench with the stages of every variant.
pub(crate) struct Device {
    /// Rays of a whole batch.
    pub(crate) rays: usize,
    bench: Workbench,
    /// Of each variant: selection, and compositing behind it.
    variants: Vec<Vec<Stage>>,
    timer: Option<Timer>,
    repeats: u32,
}

impl Device {
    /// Builds the kernels of all variants, for batches of `rays` with up to `most_steps` samples each.
    ///
    /// # Errors
    /// When the adapter cannot hold the samples or refuses a kernel.
    pub(crate) fn new(gpu: &Arc<Gpu>, rays: usize, most_steps: usize, repeats: u32) -> Result<Self> {
        let mut setup = Setup::tiny();
        let most = if gpu.is_cpu() { SAMPLES_ON_CPU } else { SAMPLES_ON_GPU };
        let samples = most.min(rays * most_steps).max(most_steps);
        let batch = &mut setup.config.batch;
        (batch.samples, batch.kept, batch.rays) = (samples, samples, batch.rays.max(rays));
        let bench = Workbench::new(gpu, &setup)?;
        let variants =
            Variant::ALL.into_iter().map(|variant| stages(&bench, variant)).collect::<Result<_>>()?;
        Ok(Self { rays, bench, variants, timer: Timer::new(gpu).ok(), repeats })
    }

    /// Rays that fit at once, each of `steps` samples.
    pub(crate) fn chunk(&self, steps: usize) -> usize {
        (self.bench.plan.config.batch.samples / steps).clamp(1, self.rays)
    }

    /// Whether times are measured.
    pub(crate) fn has_timer(&self) -> bool {
        self.timer.is_some()
    }

    /// Puts a chunk of rays on the device: steps, and log-densities as the density network's output.
    ///
    /// # Errors
    /// When there are too many, or the device was lost.
    pub(crate) fn upload(&self, rays: &[Samples]) -> Result<()> {
        let training_ray = |ray: &Samples| TrainingRay {
            direction: DVec3::Z,
            samples: vec![
                RaySample {
                    position: DVec3::ZERO,
                    delta: ray.delta,
                    gains: [1.0; 2],
                    distance: 0.0,
                };
                ray.s.len()
            ],
            target: [0.0; 4],
            background: [0.0; 3],
            depth: 0.0,
        };
        self.bench.upload(&rays.iter().map(training_ray).collect::<Vec<_>>())?;
        let raw: Vec<f32> = rays.iter().flat_map(|ray| &ray.s).map(|&s| s as f32).collect();
        self.bench.set_raw_density(&raw);
        Ok(())
    }

    /// Renders the chunk that was uploaded, in the variant `index`.
    ///
    /// # Errors
    /// When the device was lost, or left rays out.
    pub(crate) fn render(&mut self, index: usize, rays: &[Samples]) -> Result<Outcome> {
        let (bench, stages) = (&self.bench, &self.variants[index]);
        bench.run(&stages[..SELECTING.len()])?;
        let counters = bench.counters()?;
        ensure!(
            counters.rays_used as usize == rays.len(),
            "the device composites {} of {} rays: its driver does not run the kernels as it should",
            counters.rays_used,
            rays.len()
        );
        let kept = counters.kept as usize;
        let colors: Vec<[f32; 3]> =
            rays.iter().flat_map(|ray| &ray.color).map(|color| color.map(|c| c as f32)).collect();
        let color = |row: nerf::verify::check::KeptSample| {
            let [r, g, b] =
                colors.get(row.sample as usize).context("a kept sample is none of those uploaded")?;
            Ok([*r, *g, *b, 0.0])
        };
        let colors: Vec<[f32; 4]> = bench.kept(kept)?.into_iter().map(color).collect::<Result<_>>()?;
        bench.write("color", &colors);
        let seconds = match &mut self.timer {
            Some(timer) => Some(median_seconds(bench, stages, timer, self.repeats)?),
            None => {
                bench.run(stages)?;
                None
            }
        };
        let results = bench.results(rays.len())?;
        Ok(Outcome {
            rendered: results.iter().map(|ray| ray.rendered.map(f64::from)).collect(),
            kept,
            seconds,
        })
    }
}

/// Selection, as a training run has it, and compositing, with the variant's constants.
fn stages(bench: &Workbench, variant: Variant) -> Result<Vec<Stage>> {
    let mut config = Config::clone(&bench.plan.config);
    config.selection.stop_transmittance = variant.stop();
    config.transmittance = variant.transmittance;
    let plan = Plan { config: config.into(), ..bench.plan.clone() };
    let mut stages = color::stages(&bench.gpu, &plan, &bench.workspace, color::SelectionMode::Training)?;
    stages.retain(|stage| SELECTING.contains(&stage.bound.label.as_str()));
    ensure!(stages.len() == SELECTING.len(), "selection has {} of the stages {SELECTING:?}", stages.len());
    stages.push(composite::stage(&bench.gpu, &plan, &bench.workspace, false)?);
    Ok(stages)
}

/// Seconds on the device of all stages together: the median of some repeats, behind one that is not counted.
fn median_seconds(bench: &Workbench, stages: &[Stage], timer: &mut Timer, repeats: u32) -> Result<f64> {
    let mut times = Vec::new();
    for _ in 0..=repeats {
        let before: f64 = timer.totals().values().sum();
        bench.gpu.run("quadrature", stages, Some(&mut *timer))?;
        timer.collect(&bench.gpu, None)?;
        times.push(timer.totals().values().sum::<f64>() - before);
    }
    let counted = &mut times[1..];
    counted.sort_by(f64::total_cmp);
    Ok(counted[counted.len() / 2])
}
