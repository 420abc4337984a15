//! The fused kernel: rays of any number and length through it, and how far it is from what is expected.

use super::inputs::Random;
use super::stress_rays::StressRay;
use super::{CheckResult, CheckedAdapter, Setup, Workbench};
use crate::config::Transmittance;
use crate::field::generated::group_size;
use crate::field::{Counters, composite};
use crate::gpu::pass::Stage;
use crate::verify::reference::composite::{CompositeInput, CompositeOutput};
use crate::verify::reference::vectors::{Expected, GoldenFile, RayError};
use anyhow::{Context, Result};

/// Largest error of a ray, see [`RayError`].
pub const BOUND: f64 = 5e-5;

/// Samples and rays of one run of the kernel; a longer ray gets a larger workbench.
pub(super) const SAMPLES: usize = 1 << 14;
const RAYS: usize = 1 << 12;
/// Samples of the longest ray that can be marched: so many that plain sums would be wrong.
const LONGEST: usize = 1 << 14;

/// The fused kernel, without an early stop.
#[derive(Debug)]
pub struct Fused {
    /// The buffers.
    pub(super) bench: Workbench,
    stage: Stage,
    /// Samples of one run.
    samples: usize,
}

impl Fused {
    /// The kernel of a convention, with room for rays of `longest` samples.
    ///
    /// # Errors
    /// When the adapter cannot hold them.
    pub fn new(adapter: &CheckedAdapter, convention: Transmittance, longest: usize) -> Result<Self> {
        let samples = SAMPLES.max(longest);
        let mut setup = Setup::tiny().transmittance(convention);
        setup.config.batch.kept = samples;
        setup.config.batch.samples = samples;
        setup.config.batch.rays = RAYS;
        let context = || format!("the longest ray has {longest} samples");
        let bench = adapter.workbench(setup).with_context(context)?;
        let stage = composite::stage(&bench.gpu, &bench.plan, &bench.workspace, true)?;
        Ok(Self { bench, stage, samples })
    }

    /// What the kernel makes of `rays`. They need not be the batch that their `rays_in_batch` counts, and may be more
    /// than it: as many are run at once as fit, and as there are in a batch.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn run(&self, rays: &[CompositeInput<'_>]) -> Result<Vec<CompositeOutput>> {
        let mut outputs = Vec::with_capacity(rays.len());
        let mut rest = rays;
        while let Some(first) = rest.first() {
            let mut samples = 0;
            let fits = |ray: &&CompositeInput<'_>| {
                samples += ray.s.len();
                samples <= self.samples && ray.rays_in_batch == first.rays_in_batch
            };
            let most = RAYS.min(batch_of(first) as usize);
            let count = rest.iter().take(most).take_while(fits).count().max(1);
            outputs.extend(self.run_once(&rest[..count])?);
            rest = &rest[count..];
        }
        Ok(outputs)
    }

    fn run_once(&self, rays: &[CompositeInput<'_>]) -> Result<Vec<CompositeOutput>> {
        let spans = self.upload(rays);
        self.outputs(rays, &spans)
    }

    /// Runs the kernel on what was uploaded.
    pub(super) fn outputs(
        &self,
        rays: &[CompositeInput<'_>],
        spans: &[[u32; 2]],
    ) -> Result<Vec<CompositeOutput>> {
        let bench = &self.bench;
        bench.run([&self.stage])?;
        let samples = rays.iter().map(|ray| ray.s.len()).sum();
        let results = bench.results(rays.len())?;
        let gradients: Vec<[f32; 4]> = bench.read("d_color", samples)?;
        let weights: Vec<f32> = bench.read("weights", samples)?;
        let output = |(index, ray): (usize, &CompositeInput<'_>)| {
            let [first, count] = spans[index].map(|x| x as usize);
            let range = first..first + count;
            let loss_terms = results[index].errors.map(f64::from);
            let gradients = &gradients[range.clone()];
            let rendered = results[index].rendered.map(f64::from);
            CompositeOutput {
                rendered,
                loss_terms,
                loss: loss_terms.iter().sum::<f64>() / (4.0 * f64::from(batch_of(ray))),
                weights: weights[range].iter().map(|&w| f64::from(w)).collect(),
                transmittance_end: f64::NAN,
                d_color: gradients.iter().map(|d| [d[0], d[1], d[2]].map(f64::from)).collect(),
                d_s: gradients.iter().map(|d| f64::from(d[3])).collect(),
            }
        };
        Ok(rays.iter().enumerate().map(output).collect())
    }

    /// Writes the rays as if their samples had been chosen and coloured; returns first sample and number of each.
    pub(super) fn upload(&self, rays: &[CompositeInput<'_>]) -> Vec<[u32; 2]> {
        let (mut spans, mut steps, mut colors) = (Vec::new(), Vec::new(), Vec::new());
        for ray in rays {
            spans.push([steps.len() as u32, ray.s.len() as u32]);
            steps.extend(ray.s.iter().zip(ray.delta).map(|(&s, &delta)| [s as f32, delta as f32]));
            colors.extend(ray.color.iter().map(|c| [c[0] as f32, c[1] as f32, c[2] as f32, 0.0]));
        }
        let bench = &self.bench;
        bench.set_kept_steps(&steps);
        bench.write("color", &colors);
        bench.set_targets(rays.iter().map(|ray| (ray.target, ray.background, 0.0)));
        // The batch may have more rays than these: the other threads find no samples.
        spans.resize(rays.len().next_multiple_of(group_size()), [0, 0]);
        bench.write("kept_spans", &spans);
        let (count, kept) = (rays.len() as u32, steps.len() as u32);
        let rays_used = rays.first().map_or(0, batch_of);
        bench.set_counters(Counters { rays: count, rays_used, kept, ..Counters::default() });
        spans
    }
}

/// `M`, as the reference takes it.
fn batch_of(ray: &CompositeInput<'_>) -> u32 {
    ray.rays_in_batch.max(1)
}

/// The error of every ray of a file.
///
/// # Errors
/// When the adapter cannot hold the longest ray, or the device was lost.
pub fn golden_rays(adapter: &CheckedAdapter, file: &GoldenFile) -> Result<Vec<RayError>> {
    let longest = file.rays.iter().map(|ray| ray.s.len()).max().unwrap_or(0);
    let fused = Fused::new(adapter, file.transmittance, longest)?;
    let inputs: Vec<_> = file.rays.iter().map(|ray| file.input(ray)).collect();
    let outputs = fused.run(&inputs)?;
    Ok(file.rays.iter().zip(&outputs).map(|(ray, output)| RayError::new(&ray.expect, output)).collect())
}

/// Compositing, loss and gradients of stress rays, in both conventions.
///
/// # Errors
/// When the device was lost or refuses the kernel.
pub fn fused(adapter: &CheckedAdapter) -> Result<Vec<CheckResult>> {
    Ok(vec![
        of_convention(adapter, Transmittance::Exclusive)?,
        of_convention(adapter, Transmittance::Inclusive)?,
    ])
}

fn of_convention(adapter: &CheckedAdapter, convention: Transmittance) -> Result<CheckResult> {
    let name = match convention {
        Transmittance::Exclusive => "render, loss, gradient: exclusive",
        Transmittance::Inclusive => "render, loss, gradient: inclusive",
    };
    let mut result =
        CheckResult::new(name, BOUND, "T = e^-depth: depths up to 90 round to 4e-6, as do their terms");
    let rays = StressRay::many(&mut Random::new(1), 11 * StressRay::KINDS, LONGEST);
    let m = rays.len() as u32;
    let inputs: Vec<_> = rays.iter().map(|ray| ray.input(m)).collect();
    let outputs = Fused::new(adapter, convention, LONGEST)?.run(&inputs)?;
    for ((ray, input), output) in rays.iter().zip(&inputs).zip(&outputs) {
        let error = RayError::new(&Expected::of(convention, input), output);
        result.error(error.error, || format!("{} of '{}'", error.quantity, ray.name));
        // Every value of the ray was compared.
        result.cases += 4 + 5 * ray.s.len();
    }
    Ok(result)
}
