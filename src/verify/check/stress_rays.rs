//! Rays on which compositing in single precision goes wrong where anything is done carelessly.

use super::inputs::Random;
use crate::config::Transmittance;
use crate::verify::reference::composite::{CompositeInput, composite};
use crate::verify::reference::vectors::{Expected, GoldenFile, GoldenRay};

/// A ray with its own memory; its numbers are those of single precision.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StressRay {
    /// What is hard about it.
    pub name: String,
    /// Log-densities.
    pub s: Vec<f64>,
    /// Steps.
    pub delta: Vec<f64>,
    /// Colours.
    pub color: Vec<[f64; 3]>,
    /// Target colour and opacity.
    pub target: [f64; 4],
    /// Colour behind it.
    pub background: [f64; 3],
}

/// Where a sample is.
#[derive(Clone, Copy)]
struct SamplePlace {
    /// Which of the ray's samples.
    i: f64,
    /// Samples of the ray, at least 1.
    n: f64,
    /// Uniform in 0..1, the same for all samples of the ray.
    level: f64,
}

/// The colours of a ray.
#[derive(Clone, Copy, PartialEq)]
enum RayColors {
    /// Within 0..1.
    Display,
    /// From 1e-5 to 1e8, evenly in their logarithm.
    Bright,
    /// The same for all samples and the background.
    Uniform,
    /// The same for all samples, another one for the background.
    Two,
    /// White before grey, where black is wanted.
    Motes,
    /// Nothing but the last sample, which is as bright as 1e8.
    Last,
}

/// A kind of stress rays.
struct RayKind {
    name: &'static str,
    light: RayColors,
    /// `ln τ` and `ln δ` of a sample. Beyond ±1e6, the first is the log-density itself.
    depth: fn(&mut Random, SamplePlace) -> [f64; 2],
}

const fn kind(
    name: &'static str,
    light: RayColors,
    depth: fn(&mut Random, SamplePlace) -> [f64; 2],
) -> RayKind {
    RayKind { name, light, depth }
}

/// Logarithm of a share of an optical depth from 0.1 to 300.
fn share(place: SamplePlace) -> f64 {
    (0.1 * 3000f64.powf(place.level) / place.n).ln()
}

const KINDS: [RayKind; 24] = [
    kind("ordinary", RayColors::Display, |r, _| [r.number(-6.0, 1.0), r.number(-6.0, -1.0)]),
    kind("thin everywhere", RayColors::Display, |_, at| [-23.0 + 20.0 * at.level, -4.0]),
    kind("thin, against the light", RayColors::Last, |_, at| [-23.0 + 20.0 * at.level, -4.0]),
    kind("even fog", RayColors::Display, |_, at| [share(at), -4.0]),
    kind("bright even fog", RayColors::Bright, |_, at| [share(at), -4.0]),
    kind("uneven bright fog", RayColors::Bright, |r, at| {
        [share(at) + r.number(-3.0, 1.0), r.number(-60.0, 20.0)]
    }),
    kind("even fog of one colour", RayColors::Uniform, |_, at| [share(at), -4.0]),
    kind("haze of one colour before another", RayColors::Two, |_, at| {
        [(0.3f64.powf(1.0 + 6.0 * at.level) / at.n).ln(), -4.0]
    }),
    kind("haze of one colour before another", RayColors::Two, |_, at| {
        [(0.9 - 0.4 * at.level).ln() - at.n.ln(), -4.0]
    }),
    // Each of them is too little to change the sum on its own.
    kind("motes behind half a wall", RayColors::Motes, |_, at| {
        [if at.i < 1.0 { -0.3665 } else { -17.0 + 0.3 * at.level }, -4.0]
    }),
    kind("even fog of one colour before another", RayColors::Two, |_, at| [share(at), -4.0]),
    kind("dark fog before a light", RayColors::Last, |_, at| [share(at), -4.0]),
    kind("wall behind fog", RayColors::Display, |r, at| {
        [if at.i + 1.0 < at.n { share(at) } else { r.number(2.0, 69.0) }, -6.0]
    }),
    kind("bright wall behind fog", RayColors::Bright, |r, at| {
        [if at.i + 1.0 < at.n { share(at) } else { r.number(2.0, 69.0) }, -6.0]
    }),
    kind("wall in front", RayColors::Bright, |r, at| {
        [if at.i < 1.0 { r.number(2.0, 6.0) } else { share(at) }, -6.0]
    }),
    kind("every other step empty", RayColors::Display, |r, at| {
        [r.number(-2.0, 4.0), if at.i % 2.0 < 1.0 { f64::NEG_INFINITY } else { -5.0 }]
    }),
    kind("sixty decades", RayColors::Display, |r, _| [r.number(-69.0, 69.0), r.number(-100.0, 69.0)]),
    kind("sixty decades, bright", RayColors::Bright, |r, _| [r.number(-69.0, 69.0), r.number(-100.0, 69.0)]),
    kind("huge densities, tiny steps", RayColors::Display, |r, at| [share(at), r.number(-87.0, -80.0)]),
    kind("subnormal steps", RayColors::Display, |r, at| {
        [share(at) + r.number(-4.0, 1.0), r.number(-102.0, -87.0)]
    }),
    kind("vast steps", RayColors::Display, |r, at| [share(at), r.number(60.0, 85.0)]),
    kind("beyond all densities", RayColors::Display, |r, at| {
        [
            [1e30, -1e30, share(at), 1e7][r.number(0.0, 4.0) as usize],
            [-87.0, 0.0][r.number(0.0, 2.0) as usize],
        ]
    }),
    kind("at the end of the series", RayColors::Display, |r, _| [r.number(0.34, 0.36).ln(), -2.0]),
    kind("ever denser", RayColors::Bright, |_, at| [-50.0 + 60.0 * at.i / at.n, -30.0 * at.level]),
];

impl StressRay {
    /// How many kinds there are.
    pub const KINDS: usize = KINDS.len();

    /// A random ray of one of the kinds, counted round.
    pub fn new(random: &mut Random, number: usize, samples: usize) -> Self {
        let RayKind { name, light, depth } = KINDS[number % Self::KINDS];
        let n = samples.max(1) as f64;
        let level = random.number(0.0, 1.0);
        let mut ray = Self { name: format!("{name}, {samples} samples, {level:.3}"), ..Self::default() };
        for i in 0..samples {
            let [ln_tau, ln_delta] = depth(random, SamplePlace { i: i as f64, n, level });
            let delta = single(ln_delta.exp());
            ray.delta.push(delta);
            let s = if delta == 0.0 || ln_tau.abs() > 1e6 { ln_tau } else { ln_tau - delta.ln() };
            ray.s.push(single(s));
            ray.color.push(color(random, light, i + 1 == samples));
        }
        ray.background = color(random, light, false);
        let is_lit = random.number(0.0, 1.0) < 0.5;
        let [r, g, b] = color(random, light, is_lit);
        ray.target = [r, g, b, random.number(0.0, 1.0)];
        match light {
            RayColors::Uniform => ray.color.fill(ray.background),
            RayColors::Two => ray.color.fill(color(random, light, false)),
            RayColors::Motes => (ray.background, ray.target) = ([single(0.51); 3], [0.0; 4]),
            _ => {}
        }
        ray
    }

    /// `count` rays of all kinds with up to `longest` samples; some fit their target exactly.
    pub fn many(random: &mut Random, count: usize, longest: usize) -> Vec<Self> {
        let lengths = [4096, 0, 1, 2, 3, 7, 33, 130, 500, 1024, 1 << 14];
        (0..count)
            .map(|number| {
                let samples = lengths[number / Self::KINDS % lengths.len()].min(longest);
                let mut ray = Self::new(random, number, samples);
                let met = [(6, Transmittance::Exclusive), (3, Transmittance::Inclusive)];
                for (_, convention) in met.into_iter().filter(|(rest, _)| number % 7 == *rest) {
                    ray.target = composite(convention, &ray.input(1)).rendered.map(single);
                    ray.name += &format!(", met if {convention:?}");
                }
                ray
            })
            .collect()
    }

    /// The ray as compositing takes it, in a batch of `rays_in_batch`.
    #[must_use]
    pub fn input(&self, rays_in_batch: u32) -> CompositeInput<'_> {
        CompositeInput {
            s: &self.s,
            delta: &self.delta,
            color: &self.color,
            target: self.target,
            background: self.background,
            rays_in_batch,
        }
    }

    /// Rays and what the reference makes of them, as a file.
    #[must_use]
    pub fn golden(convention: Transmittance, rays_in_batch: u32, rays: &[Self]) -> GoldenFile {
        let golden = |ray: &Self| {
            let [r, g, b, gt_alpha] = ray.target;
            GoldenRay {
                name: ray.name.clone(),
                s: ray.s.clone(),
                delta: ray.delta.clone(),
                c: ray.color.clone(),
                gt: [r, g, b],
                gt_alpha,
                background: ray.background,
                expect: Expected::of(convention, &ray.input(rays_in_batch)),
            }
        };
        let rays: Vec<_> = rays.iter().map(golden).collect();
        let loss = Some(rays.iter().map(|ray| ray.expect.loss).sum());
        GoldenFile { transmittance: convention, rays_in_batch, loss, rays }
    }
}

/// The nearest number of single precision.
fn single(x: f64) -> f64 {
    f64::from(x as f32)
}

fn color(random: &mut Random, light: RayColors, is_last: bool) -> [f64; 3] {
    std::array::from_fn(|_| match light {
        RayColors::Motes => 1.0,
        RayColors::Display | RayColors::Uniform | RayColors::Two => random.number(0.0, 1.0),
        RayColors::Bright => single(10f64.powf(random.number(-5.0, 8.0))),
        RayColors::Last => {
            if is_last {
                random.number(0.5e8, 1e8)
            } else {
                0.0
            }
        }
    })
}
