//! The printed equations next to those in use, as tables.

pub(crate) mod stiff;
pub(crate) mod textbook;

use super::Outcome;
use anyhow::Result;
use clap::Args;
use nerf::config::Transmittance;
use nerf::gpu::Gpu;
use nerf::run::results::{circumstances, joined, markdown, write_text};
use nerf::support::file::writable_folder;
use nerf::support::file::write_json;
use nerf::verify::check::fused::Fused;
use nerf::verify::check::{CheckedAdapter, Forced};
use nerf::verify::reference::composite::{CompositeInput, CompositeOutput, composite};
use nerf::verify::reference::vectors::{GoldenFile, GoldenRay, RayError};
use serde::Serialize;
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;
use textbook::{Precision, textbook_d_s};

const CONVENTIONS: [Transmittance; 2] = [Transmittance::Exclusive, Transmittance::Inclusive];
/// Optical depths of the slabs.
const DEPTHS: [f64; 3] = [1.0, 5.0, 50.0];
/// Powers of two: 1 to 1024 samples.
const POWERS: std::ops::RangeInclusive<u32> = 0..=10;

/// `equations`
#[derive(Args, Debug)]
pub(crate) struct Equations {
    /// Folder to write equations.json and equations.md to
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// File of golden rays; may be repeated [default: rays computed in 64 bits]
    #[arg(long, value_name = "FILE")]
    vectors: Vec<PathBuf>,
}

/// Opacity of a homogeneous slab.
#[derive(Debug, Serialize)]
struct Slab {
    optical_depth: f64,
    samples: usize,
    exact: f64,
    exclusive: Opacity,
    inclusive: Opacity,
}

/// In one convention.
#[derive(Debug, Serialize)]
struct Opacity {
    kernel: f64,
    reference: f64,
}

/// Gradients by log-density of one kind of rays.
#[derive(Debug, Serialize)]
struct Gradients {
    transmittance: Transmittance,
    family: String,
    rays: usize,
    /// Total minus prefix, every operation rounded to f32.
    textbook: Worst,
    /// The backward walk of the fused kernel.
    kernel: Worst,
}

/// The worst ray: the largest difference from the exact gradient, relative to the size of the terms that it is summed
/// from, of the rays that are finite.
#[derive(Clone, Copy, Debug, Default, Serialize)]
struct Worst {
    error: f64,
    /// Rays with a gradient that is not finite.
    not_finite: usize,
}

/// The files of golden rays are read before anything is measured.
pub(crate) fn run(args: &Equations, gpu: &Arc<Gpu>) -> Result<Outcome> {
    let files = match args.vectors.as_slice() {
        [] => CONVENTIONS.map(stiff::golden).to_vec(),
        paths => paths.iter().map(|path| GoldenFile::load(path)).collect::<Result<_>>()?,
    };
    if let Some(folder) = &args.out {
        writable_folder(folder)?;
    }
    let slabs = slabs(gpu)?;
    let mut gradients = Vec::new();
    for file in &files {
        gradients.extend(compare(gpu, file)?);
    }
    let text = describe(&slabs, &gradients);
    let result = joined(circumstances(gpu), json!({ "slabs": slabs, "gradients": gradients }));
    if let Some(folder) = &args.out {
        write_json(&folder.join("equations.json"), &result)?;
        write_text(&folder.join("equations.md"), &(text.clone() + "\n"))?;
    }
    Ok(Outcome { json: result, text })
}

fn slabs(gpu: &Arc<Gpu>) -> Result<Vec<Slab>> {
    let cases: Vec<(f64, usize)> =
        DEPTHS.into_iter().flat_map(|depth| POWERS.map(move |power| (depth, 1 << power))).collect();
    let most = 1 << POWERS.end();
    let logs: Vec<Vec<f64>> = cases.iter().map(|&(depth, samples)| vec![depth.ln(); samples]).collect();
    let steps: Vec<Vec<f64>> =
        cases.iter().map(|&(_, samples)| vec![1.0 / samples as f64; samples]).collect();
    let color = vec![[1.0; 3]; most];
    let rays: Vec<CompositeInput<'_>> = (logs.iter().zip(&steps))
        .map(|(s, delta)| CompositeInput {
            s,
            delta,
            color: &color[..s.len()],
            target: [0.0; 4],
            background: [0.0; 3],
            rays_in_batch: cases.len() as u32,
        })
        .collect();
    let both = CONVENTIONS.map(|convention| -> Result<Vec<Opacity>> {
        let kernel = composited(gpu, convention, &rays)?;
        let pairs = kernel.iter().zip(&rays);
        let opacity = |(kernel, ray): (&CompositeOutput, &CompositeInput<'_>)| Opacity {
            kernel: kernel.rendered[3],
            reference: composite(convention, ray).rendered[3],
        };
        Ok(pairs.map(opacity).collect())
    });
    let [exclusive, inclusive] = both;
    let opacities = exclusive?.into_iter().zip(inclusive?);
    let slab = |((optical_depth, samples), (exclusive, inclusive)): ((f64, usize), (Opacity, Opacity))| {
        Slab { optical_depth, samples, exact: -(-optical_depth).exp_m1(), exclusive, inclusive }
    };
    Ok(cases.into_iter().zip(opacities).map(slab).collect())
}

/// What the fused kernel makes of `rays`.
fn composited(
    gpu: &Arc<Gpu>,
    convention: Transmittance,
    rays: &[CompositeInput<'_>],
) -> Result<Vec<CompositeOutput>> {
    let longest = rays.iter().map(|ray| ray.s.len()).max().unwrap_or(0);
    Fused::new(&CheckedAdapter::new(gpu, Forced::default())?, convention, longest)?.run(rays)
}

/// The rays of a file by name, in the order in which the names appear.
fn compare(gpu: &Arc<Gpu>, file: &GoldenFile) -> Result<Vec<Gradients>> {
    let inputs: Vec<_> = file.rays.iter().map(|ray| file.input(ray)).collect();
    let outputs = composited(gpu, file.transmittance, &inputs)?;
    let mut families: Vec<Gradients> = Vec::new();
    for ((ray, input), output) in file.rays.iter().zip(&inputs).zip(outputs) {
        let index = families.iter().position(|family| family.family == ray.name).unwrap_or_else(|| {
            families.push(Gradients {
                transmittance: file.transmittance,
                family: ray.name.clone(),
                rays: 0,
                textbook: Worst::default(),
                kernel: Worst::default(),
            });
            families.len() - 1
        });
        let family = &mut families[index];
        family.rays += 1;
        let exact = composite(file.transmittance, input);
        family.textbook.add(ray, &exact, textbook_d_s(file.transmittance, Precision::Single, input));
        family.kernel.add(ray, &exact, output.d_s);
    }
    Ok(families)
}

impl Worst {
    /// Takes a ray's gradient in: everything else about the ray is as the reference has it.
    fn add(&mut self, ray: &GoldenRay, exact: &CompositeOutput, d_s: Vec<f64>) {
        let error = RayError::new(&ray.expect, &CompositeOutput { d_s, ..exact.clone() });
        match error.finite {
            true => self.error = self.error.max(error.error),
            false => self.not_finite += 1,
        }
    }

    fn text(&self) -> String {
        match self.not_finite {
            0 => format!("{:.1e}", self.error),
            _ => "not finite".to_owned(),
        }
    }
}

fn describe(slabs: &[Slab], gradients: &[Gradients]) -> String {
    let mut parts = Vec::new();
    let header = ["samples", "exclusive", "in 64 bits", "inclusive", "in 64 bits", "exact"];
    for depth in DEPTHS {
        let row = |slab: &Slab| {
            let opacities = [&slab.exclusive, &slab.inclusive].map(|sum| [sum.kernel, sum.reference]);
            let numbers = opacities.as_flattened().iter().chain([&slab.exact]);
            let cells = numbers.map(|number| format!("{number:.7}"));
            std::iter::once(slab.samples.to_string()).chain(cells).collect()
        };
        let rows: Vec<Vec<String>> =
            slabs.iter().filter(|slab| slab.optical_depth == depth).map(row).collect();
        parts.push(format!(
            "Opacity of a homogeneous slab of optical depth {depth}\n\n{}",
            markdown(&header, &rows)
        ));
    }
    let header = ["rays", "sum", "number", "total minus prefix, f32", "backward walk, kernel"];
    let row = |family: &Gradients| {
        vec![
            family.family.clone(),
            format!("{:?}", family.transmittance).to_lowercase(),
            family.rays.to_string(),
            family.textbook.text(),
            family.kernel.text(),
        ]
    };
    let rows: Vec<_> = gradients.iter().map(row).collect();
    let title = "Worst error of the gradient by log-density, relative to the size of its terms";
    parts.push(format!("{title}\n\n{}", markdown(&header, &rows)));
    parts.join("\n\n")
}
