//! The fused kernel against golden rays and against the reference on random ones.

use std::path::Path;

use nerf::gpu::pass::Stage;
use nerf::kernels::{Counters, training};
use nerf::reference::Transmittance;
use nerf::reference::composite::{CompositeInput, CompositeOutput, composite};
use nerf::reference::vectors::{GoldenFile, RayError};

use crate::bench::{Bench, Random, Setup};
use crate::close::{assert_close, assert_close_to_scale};

const CONVENTIONS: [Transmittance; 2] = [Transmittance::Exclusive, Transmittance::Inclusive];

/// Largest error of a golden ray.
const BOUND: f64 = 5e-5;

fn bench(convention: Transmittance) -> (Bench, Stage) {
    let mut setup = Setup::tiny().transmittance(convention);
    setup.config.batch.kept = 8192;
    setup.config.batch.samples = 16384;
    let bench = Bench::new(&setup);
    let stage = training::composite(&bench.gpu, &bench.plan, &bench.workspace, true).expect("composite");
    (bench, stage)
}

/// Runs the kernel on `rays`, which are a whole batch.
fn run(bench: &Bench, stage: &Stage, rays: &[CompositeInput]) -> Vec<CompositeOutput> {
    let (mut spans, mut steps, mut colors) = (Vec::new(), Vec::new(), Vec::new());
    for ray in rays {
        spans.push([steps.len() as u32, ray.s.len() as u32]);
        steps.extend(ray.s.iter().zip(ray.delta).map(|(&s, &delta)| [s as f32, delta as f32]));
        colors.extend(ray.color.iter().map(|c| [c[0] as f32, c[1] as f32, c[2] as f32, 0.0]));
    }
    bench.write("kept_spans", &spans);
    bench.set_kept_steps(&steps);
    bench.write("color", &colors);
    bench.write("targets", &rays.iter().map(|ray| ray.target.map(|x| x as f32)).collect::<Vec<_>>());
    let background = |ray: &CompositeInput| {
        let [r, g, b] = ray.background.map(|x| x as f32);
        [r, g, b, 0.0]
    };
    bench.write("backgrounds", &rays.iter().map(background).collect::<Vec<_>>());
    let (count, kept) = (rays.len() as u32, steps.len() as u32);
    bench.set_counters(Counters { rays: count, rays_used: count, kept, ..Counters::default() });
    bench.run([stage]);

    let rendered: Vec<[f32; 4]> = bench.read("rendered", rays.len());
    let errors: Vec<[f32; 4]> = bench.read("ray_errors", rays.len());
    let gradients: Vec<[f32; 4]> = bench.read("d_color", steps.len());
    let weights: Vec<f32> = bench.read("weights", steps.len());
    (spans.iter().enumerate())
        .map(|(ray, &[first, count])| {
            let range = first as usize..(first + count) as usize;
            let loss_terms = errors[ray].map(f64::from);
            CompositeOutput {
                rendered: rendered[ray].map(f64::from),
                loss_terms,
                loss: loss_terms.iter().sum::<f64>() / (4.0 * f64::from(rays[ray].rays_in_batch)),
                weights: weights[range.clone()].iter().map(|&w| f64::from(w)).collect(),
                transmittance_end: 0.0,
                d_color: gradients[range.clone()].iter().map(|d| [d[0], d[1], d[2]].map(f64::from)).collect(),
                d_s: gradients[range].iter().map(|d| f64::from(d[3])).collect(),
            }
        })
        .collect()
}

#[test]
fn golden_rays_are_met() {
    for convention in CONVENTIONS {
        let name = match convention {
            Transmittance::Exclusive => "composite_exclusive.json",
            Transmittance::Inclusive => "composite_inclusive.json",
        };
        let file = GoldenFile::load(&Path::new("tests/vectors").join(name)).expect("golden rays");
        assert_eq!(file.rays_in_batch as usize, file.rays.len());
        let (bench, stage) = bench(convention);
        let inputs: Vec<_> = file.rays.iter().map(|ray| file.input(ray)).collect();
        let outputs = run(&bench, &stage, &inputs);
        let mut worst = (0.0, "none", "none");
        for (ray, output) in file.rays.iter().zip(&outputs) {
            let error = RayError::new(&ray.expect, output);
            assert!(error.finite, "{convention:?}: '{}' is not finite", ray.name);
            if error.error > worst.0 {
                worst = (error.error, &ray.name, error.quantity);
            }
        }
        println!("{convention:?} golden rays: worst {:.2e}, '{}', {}", worst.0, worst.1, worst.2);
        assert!(worst.0 <= BOUND, "{convention:?}: '{}' is off by {:e} in {}", worst.1, worst.0, worst.2);
    }
}

/// A ray with its own memory.
struct Ray {
    s: Vec<f64>,
    delta: Vec<f64>,
    color: Vec<[f64; 3]>,
    target: [f64; 4],
    background: [f64; 3],
}

impl Ray {
    fn random(random: &mut Random, samples: usize, high: f64) -> Self {
        let exact = |numbers: Vec<f32>| numbers.into_iter().map(f64::from).collect();
        Self {
            s: exact(random.numbers(samples, -6.0, 6.0)),
            delta: exact(random.numbers(samples, 0.001, 0.1)),
            color: (0..samples).map(|_| random.vector(0.0, high).to_array()).collect(),
            target: random.vector(0.0, high).extend(random.number(0.0, 1.0)).to_array(),
            background: random.vector(0.0, high).to_array(),
        }
    }

    fn input(&self, rays_in_batch: usize) -> CompositeInput<'_> {
        CompositeInput {
            s: &self.s,
            delta: &self.delta,
            color: &self.color,
            target: self.target,
            background: self.background,
            rays_in_batch: rays_in_batch as u32,
        }
    }
}

#[test]
fn random_rays_agree_with_the_reference() {
    let mut random = Random::new(1);
    for convention in CONVENTIONS {
        let (bench, stage) = bench(convention);
        for (count, high) in [(1, 1.0), (3, 1.0), (65, 1.0), (130, 1.0), (130, 1e4)] {
            let rays: Vec<Ray> = (0..count).map(|ray| Ray::random(&mut random, ray * 7 % 29, high)).collect();
            let inputs: Vec<_> = rays.iter().map(|ray| ray.input(count)).collect();
            let got = run(&bench, &stage, &inputs);
            let want: Vec<_> = inputs.iter().map(|ray| composite(convention, ray)).collect();
            let compare = |name: &str, values: &dyn Fn(&CompositeOutput) -> Vec<f64>, tolerance: f64| {
                let all = |outputs: &[CompositeOutput]| outputs.iter().flat_map(values).collect::<Vec<_>>();
                let name = format!("{convention:?} {name}, {count} rays to {high}");
                assert_close_to_scale(&name, &all(&got), &all(&want), tolerance);
            };
            compare("rendered", &|output| output.rendered.to_vec(), 2e-6);
            compare("loss", &|output| vec![output.loss], 2e-6);
            compare("weights", &|output| output.weights.clone(), 2e-6);
            compare("d_color", &|output| output.d_color.as_flattened().to_vec(), 2e-6);
            compare("d_s", &|output| output.d_s.clone(), 2e-6);
        }
    }
}

/// Worked out by hand. Two samples of optical depth ln 2, so α = 1/2 and T = 1, 1/2, 1/4; colours 1 and 0
/// in red; background 1, target 0 and opacity 1; one ray:
/// R_r = 1/2 + 1/4 = 3/4, R_α = 3/4, d_c1 = 3/8 · 1/2, d_c2 = 3/8 · 1/4.
#[test]
fn one_ray_by_hand() {
    let (bench, stage) = bench(Transmittance::Exclusive);
    let ray = Ray {
        s: vec![std::f64::consts::LN_2.ln(); 2],
        delta: vec![1.0; 2],
        color: vec![[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
        target: [0.0, 0.0, 0.0, 1.0],
        background: [1.0, 0.0, 0.0],
    };
    let output = &run(&bench, &stage, &[ray.input(1)])[0];
    assert_close("rendered by hand", &output.rendered, &[0.75, 0.0, 0.0, 0.75], 3e-7, 0.0);
    assert_close("weights by hand", &output.weights, &[0.5, 0.25], 2e-7, 0.0);
    let d_red: Vec<f64> = output.d_color.iter().map(|d| d[0]).collect();
    assert_close("d_color by hand", &d_red, &[0.1875, 0.09375], 2e-7, 0.0);
    // ln 2 · [3/8 · (1/2 (1 − 1/2) , 1/4 (0 − 1)) − 1/8 · (1/2 (1 − 1/2), 1/4 · 1)].
    let d_s = [0.25 * 0.25, -0.125].map(|d| d * std::f64::consts::LN_2);
    assert_close("d_s by hand", &output.d_s, &d_s, 2e-7, 0.0);
}
