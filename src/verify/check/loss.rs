//! The fused kernel with everything that a loss may have: errors relative to the colour, depth, distortion and sparsity.

use super::inputs::Random;
use super::workbench::KeptStep;
use super::{CheckResult, CheckedAdapter, Setup};
use crate::config::Transmittance;
use crate::config::{ColorLoss, Loss};
use crate::field::{Counters, composite};
use crate::verify::reference::composite::{CompositeInput, CompositeOutput, optical_depths};
use crate::verify::reference::loss::{Places, SPARSE_DENSITY, composite_with, distortion};
use crate::verify::reference::model::Objective;
use anyhow::Result;

/// Smaller gradients may vanish in single precision.
const LEAST: f64 = 1e-30;

/// A ray whose distances are known.
struct KnownRay {
    s: Vec<f64>,
    delta: Vec<f64>,
    color: Vec<[f64; 3]>,
    /// Distances of the samples, and of what is known to be there; 0 where nothing is.
    distances: Vec<f64>,
    goal: f64,
    target: [f64; 4],
    background: [f64; 3],
}

/// A loss, and how far away samples are.
struct Case {
    name: &'static str,
    loss: Loss,
    /// Least and largest distance, in sides of the inner cube; even in their logarithm.
    distances: [f64; 2],
    bound: (f64, &'static str),
}

/// Loss and gradients of rays of 0 to 60 samples, from transparent to opaque, in both conventions. Distortion and sparsity
/// weigh as much as all else, which would otherwise hide their errors; the former reaches over six decades of distance.
///
/// # Errors
/// When the device was lost or refuses the kernel.
pub fn further_terms(adapter: &CheckedAdapter) -> Result<Vec<CheckResult>> {
    let cases = [
        Case {
            name: "depth and relative errors",
            loss: Loss { color: ColorLoss::Relative, depth: 0.3, ..Loss::default() },
            distances: [0.1, 4.0],
            bound: (2e-5, "T = e^-depth, and distances of up to 4 round"),
        },
        Case {
            name: "distortion",
            loss: Loss { color: ColorLoss::Relative, distortion: 20.0, ..Loss::default() },
            distances: [1e-3, 1e3],
            bound: (2e-5, "T = e^-depth, and sums of weights round"),
        },
        Case {
            name: "sparsity",
            loss: Loss { color: ColorLoss::Relative, sparsity: 5.0, ..Loss::default() },
            distances: [0.1, 4.0],
            bound: (2e-5, "T = e^-depth rounds"),
        },
    ];
    cases.iter().map(|case| case.run(adapter)).collect()
}

impl Case {
    fn run(&self, adapter: &CheckedAdapter) -> Result<CheckResult> {
        let mut result = CheckResult::new(self.name, self.bound.0, self.bound.1);
        for convention in [Transmittance::Exclusive, Transmittance::Inclusive] {
            let mut setup = Setup::tiny().transmittance(convention);
            setup.config.loss = self.loss.clone();
            setup.features.depth = true;
            (setup.config.batch.kept, setup.config.batch.samples) = (8192, 8192);
            let bench = adapter.workbench(setup)?;
            let mut random = Random::new(73);
            let rays: Vec<_> =
                (0..200).map(|number| KnownRay::new(&mut random, number, self.distances)).collect();
            let mut first = 0;
            let spans: Vec<[u32; 2]> = (rays.iter())
                .map(|ray| {
                    let span = [first, ray.s.len() as u32];
                    first += span[1];
                    span
                })
                .collect();
            upload(&bench, &rays, &spans);
            bench.run([&composite::stage(&bench.gpu, &bench.plan, &bench.workspace, true)?])?;
            let gradients: Vec<[f32; 4]> = bench.read("d_color", first as usize)?;
            let results = bench.results(rays.len())?;
            for (number, (ray, [first, count])) in rays.iter().zip(spans).enumerate() {
                let range = first as usize..(first + count) as usize;
                ray.compare(
                    &mut result,
                    &bench.objective(),
                    &gradients[range],
                    results[number].errors,
                    number,
                );
            }
        }
        Ok(result)
    }
}

fn upload(bench: &super::Workbench, rays: &[KnownRay], spans: &[[u32; 2]]) {
    let all = |value: fn(&KnownRay) -> Vec<[f32; 4]>| rays.iter().flat_map(value).collect::<Vec<_>>();
    let step = |((&s, &delta), &distance): ((&f64, &f64), &f64)| {
        [[s as f32, delta as f32, 0.0, distance as f32], [1.0, 1.0, 0.0, 0.0]]
    };
    let steps: Vec<KeptStep> =
        rays.iter().flat_map(|ray| ray.s.iter().zip(&ray.delta).zip(&ray.distances).map(step)).collect();
    bench.write("kept_steps", &steps);
    bench.write("color", &all(|ray| ray.color.iter().map(|c| narrow([c[0], c[1], c[2], 0.0])).collect()));
    bench.set_targets(rays.iter().map(|ray| (ray.target, ray.background, ray.goal)));
    bench.write("kept_spans", spans);
    let (count, kept) = (rays.len() as u32, steps.len() as u32);
    bench.set_counters(Counters { rays: count, rays_used: count, kept, ..Counters::default() });
}

fn narrow(values: [f64; 4]) -> [f32; 4] {
    values.map(|value| value as f32)
}

impl KnownRay {
    /// Every fifth ray has all its samples at one distance.
    fn new(random: &mut Random, number: usize, [nearest, farthest]: [f64; 2]) -> Self {
        let count = number * 7 % 61;
        let mut numbers = |low: f64, high: f64| -> Vec<f64> {
            random.numbers(count, low, high).into_iter().map(f64::from).collect()
        };
        let (s, delta) = (numbers(-6.0, 5.0), numbers(0.01, 0.2));
        let channels = [numbers(0.0, 20.0), numbers(0.0, 1.0), numbers(0.0, 0.05)];
        let mut distances = numbers(nearest.ln(), farthest.ln());
        distances.sort_by(f64::total_cmp);
        if number % 5 == 4 {
            let first = distances.first().copied().unwrap_or_default();
            distances.fill(first);
        }
        let distances = distances.into_iter().map(|ln| f64::from(ln.exp() as f32)).collect();
        let color = (0..count).map(|i| channels.each_ref().map(|channel| channel[i])).collect();
        let mut number_in = |low: f64, high: f64| f64::from(random.number(low, high) as f32);
        Self {
            s,
            delta,
            color,
            distances,
            goal: if number % 4 == 3 { 0.0 } else { number_in(0.1, 4.0) },
            target: std::array::from_fn(|x| number_in(0.0, [20.0, 1.0, 0.05, 1.0][x])),
            background: std::array::from_fn(|_| number_in(0.0, 1.0)),
        }
    }

    fn compare(
        &self,
        result: &mut CheckResult,
        objective: &Objective,
        gradients: &[[f32; 4]],
        errors: [f32; 4],
        number: usize,
    ) {
        let input = CompositeInput {
            s: &self.s,
            delta: &self.delta,
            color: &self.color,
            target: self.target,
            background: self.background,
            rays_in_batch: 200,
        };
        let places = Places { distances: &self.distances, depth: self.goal };
        let want = composite_with(objective.loss, objective.transmittance, &input, places, &[]);
        let scales = Scales::new(objective, &input, &want, places);
        let case = |what: &str| format!("ray {number}, {what}");
        for (x, &error) in errors.iter().enumerate().take(3) {
            let weight = objective.loss.weights(want.rendered, self.target)[x];
            let size = (want.rendered[x].abs() + self.target[x].abs()).powi(2) * weight;
            result.value(error.into(), want.loss_terms[x], size, || case("squared error"));
        }
        let loss = errors.iter().map(|&error| f64::from(error)).sum::<f64>() / (4.0 * 200.0);
        result.value(loss, want.loss, scales.loss, || case("loss"));
        for (i, got) in gradients.iter().enumerate() {
            let scale = |x: usize| (scales.residual[x] * want.weights[i]).max(LEAST);
            result.each(&case("by colour"), &got[..3], &want.d_color[i], scale);
            result.value(got[3].into(), want.d_s[i], scales.d_s[i].max(LEAST), || case("by log-density"));
        }
    }
}

/// Sizes of the terms that values are summed from.
struct Scales {
    /// `v_x (|R_x| + |g_x|)/(2M)`.
    residual: [f64; 4],
    loss: f64,
    d_s: Vec<f64>,
}

impl Scales {
    fn new(
        objective: &Objective,
        ray: &CompositeInput<'_>,
        output: &CompositeOutput,
        places: Places<'_>,
    ) -> Self {
        let m = f64::from(ray.rays_in_batch);
        let loss = objective.loss;
        let v = loss.weights(output.rendered, ray.target);
        let both = |x: usize| output.rendered[x].abs() + ray.target[x].abs();
        let residual: [f64; 4] = std::array::from_fn(|x| v[x] * both(x) / (2.0 * m));
        let offset = |t: &f64| if places.depth > 0.0 { (t - places.depth).abs() } else { 0.0 };
        let offsets: Vec<f64> = places.distances.iter().map(offset).collect();
        let depth: f64 = output.weights.iter().zip(&offsets).map(|(w, offset)| w * offset).sum();
        let apart = SizeOfDistortion::new(ray, output, places);
        let shares = [residual.as_slice(), &[2.0 * loss.depth / m * depth, loss.distortion / m]].concat();
        // All terms of the sparsity have one sign, but 1 - T is a difference.
        let sparse: Vec<f64> = (ray.s.iter().zip(ray.delta))
            .map(|(s, delta)| loss.sparsity / m * delta * (s.exp() / SPARSE_DENSITY).ln_1p())
            .collect();
        let loss = (0..4).map(|x| residual[x] * both(x) / 2.0).sum::<f64>()
            + (loss.depth * depth.powi(2) + loss.distortion * apart.sum) / m
            + sparse.iter().sum::<f64>();
        let depths = optical_depths(ray);
        let mut behind = [ray.background[0], ray.background[1], ray.background[2], 0.0, 0.0, 0.0]
            .map(|background| output.transmittance_end * background);
        let mut d_s = vec![0.0; depths.len()];
        for i in (0..depths.len()).rev() {
            let [r, g, b] = ray.color[i];
            let channels = [r, g, b, 1.0, offsets[i], apart.slopes[i]];
            let passing = (-depths[..=i].iter().sum::<f64>()).exp();
            let term = |x: usize| behind[x] + (passing + output.weights[i]) * channels[x].abs();
            d_s[i] = sparse[i] + depths[i] * (0..6).map(|x| shares[x] * term(x)).sum::<f64>();
            (0..6).for_each(|x| behind[x] += output.weights[i] * channels[x].abs());
        }
        Self { residual, loss, d_s }
    }
}

/// The distortion and its slopes by the weights, with `x_i + x_j` in place of `|x_i − x_j|`.
struct SizeOfDistortion {
    sum: f64,
    slopes: Vec<f64>,
}

impl SizeOfDistortion {
    fn new(ray: &CompositeInput<'_>, output: &CompositeOutput, places: Places<'_>) -> Self {
        let w = &output.weights;
        let (sum, slopes) = distortion(w, places.distances, ray.delta);
        let x: Vec<f64> = places.distances.iter().map(|t| t / (1.0 + t)).collect();
        let all: f64 = w.iter().sum();
        let all_x: f64 = w.iter().zip(&x).map(|(w, x)| w * x).sum();
        let size = |i: usize| slopes[i] + 2.0 * (x[i] * all + all_x);
        Self { sum: sum + 2.0 * all * all_x, slopes: (0..x.len()).map(size).collect() }
    }
}
