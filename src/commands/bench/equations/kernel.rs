//! The fused kernel on rays that are given.

use anyhow::{Result, ensure};
use nerf::check::{Setup, Workbench};
use nerf::gpu::Gpu;
use nerf::kernels::{Counters, training};
use nerf::reference::Transmittance;
use nerf::reference::composite::{CompositeInput, CompositeOutput};
use std::sync::Arc;

/// What the kernel makes of `rays`, which are a batch of as many rays as the first of them says. Weights, loss and
/// the transmittance at the end are left empty.
///
/// # Errors
/// When the batch has more rays than it says, does not fit, or the device was lost.
pub(super) fn composited(
    gpu: &Arc<Gpu>,
    convention: Transmittance,
    rays: &[CompositeInput<'_>],
) -> Result<Vec<CompositeOutput>> {
    let samples: usize = rays.iter().map(|ray| ray.s.len()).sum();
    let count = rays.first().map_or(0, |ray| ray.rays_in_batch);
    ensure!(
        rays.len() <= count as usize,
        "expected a batch of at least {} rays, as many as there are, and found rays_in_batch = {count}",
        rays.len()
    );
    let mut setup = Setup::tiny().transmittance(convention);
    let batch = &mut setup.config.batch;
    (batch.samples, batch.kept) = (samples.max(batch.samples), samples.max(batch.samples));
    batch.rays = batch.rays.max(count as usize);
    let bench = Workbench::new(gpu, &setup)?;
    let stage = training::composite(gpu, &bench.plan, &bench.workspace, false)?;
    let spans = upload(&bench, rays);
    bench.set_counters(Counters {
        rays: count,
        rays_used: count,
        kept: samples as u32,
        ..Counters::default()
    });
    bench.run([&stage])?;
    let rendered: Vec<[f32; 4]> = bench.read("rendered", rays.len())?;
    let errors: Vec<[f32; 4]> = bench.read("ray_errors", rays.len())?;
    let gradients: Vec<[f32; 4]> = bench.read("d_color", samples)?;
    let output = |(ray, [first, count]): (usize, [u32; 2])| {
        let gradients = &gradients[first as usize..(first + count) as usize];
        CompositeOutput {
            rendered: rendered[ray].map(f64::from),
            loss_terms: errors[ray].map(f64::from),
            loss: 0.0,
            weights: Vec::new(),
            transmittance_end: 0.0,
            d_color: gradients.iter().map(|d| [d[0], d[1], d[2]].map(f64::from)).collect(),
            d_s: gradients.iter().map(|d| f64::from(d[3])).collect(),
        }
    };
    Ok(spans.into_iter().enumerate().map(output).collect())
}

/// Writes the rays as if their samples had been chosen and coloured; where each one's samples lie.
fn upload(bench: &Workbench, rays: &[CompositeInput<'_>]) -> Vec<[u32; 2]> {
    let (mut spans, mut steps, mut colors) = (Vec::new(), Vec::new(), Vec::new());
    for ray in rays {
        spans.push([steps.len() as u32, ray.s.len() as u32]);
        steps.extend(ray.s.iter().zip(ray.delta).map(|(&s, &delta)| [s as f32, delta as f32]));
        colors.extend(ray.color.iter().map(|c| [c[0] as f32, c[1] as f32, c[2] as f32, 0.0]));
    }
    let backgrounds: Vec<_> = rays.iter().map(|ray| ray.background.map(|x| x as f32)).collect();
    bench.write("kept_spans", &spans);
    bench.set_kept_steps(&steps);
    bench.write("color", &colors);
    bench.write("targets", &rays.iter().map(|ray| ray.target.map(|x| x as f32)).collect::<Vec<_>>());
    bench.write("backgrounds", &backgrounds.iter().map(|&[r, g, b]| [r, g, b, 0.0]).collect::<Vec<_>>());
    spans
}
