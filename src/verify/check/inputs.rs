//! Inputs of the checks: what they draw at random, and the numbers that the kernels draw.

use crate::field::Step;
use crate::verify::reference::model::{RaySample, TrainingRay};
use crate::verify::reference::random;
use glam::DVec3;

/// Seed of the kernels' random numbers in every check.
pub const SEED: u32 = 5;
/// Step of the kernels' random numbers in every check.
pub const STEP: u32 = 3;

/// The kernels' random number of `index`, uniform in [0, 1).
#[must_use]
pub fn uniform(index: usize, dimension: u32) -> f64 {
    f64::from(random::uniform(random::random_u32(SEED, STEP, index as u32, dimension)))
}

/// The step that goes with [`uniform`]; Adam's corrections are 1 and nothing is learnt.
#[must_use]
pub fn quiet_step() -> Step {
    let stream = random::pcg(STEP.wrapping_add(random::pcg(SEED)));
    Step { stream, first_correction: 1.0, second_correction: 1.0, ..Step::default() }
}

/// Reproducible numbers that f32 holds exactly.
#[derive(Clone, Debug)]
pub struct Random {
    next: u32,
}

impl Random {
    /// The sequence of `seed`.
    #[must_use]
    pub fn new(seed: u32) -> Self {
        Self { next: seed << 20 }
    }

    /// The next number, uniform in `low..high`.
    pub fn number(&mut self, low: f64, high: f64) -> f64 {
        self.next += 1;
        let unit = f64::from(random::uniform(random::random_u32(99, 0, self.next, 0)));
        f64::from((low + (high - low) * unit) as f32)
    }

    /// The next `count` numbers, uniform in `low..high`.
    pub fn numbers(&mut self, count: usize, low: f64, high: f64) -> Vec<f32> {
        (0..count).map(|_| self.number(low, high) as f32).collect()
    }

    /// A vector whose components are uniform in `low..high`.
    pub fn vector(&mut self, low: f64, high: f64) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| self.number(low, high)))
    }

    /// A direction whose length is 1 up to f32.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let vector = self.vector(-1.0, 1.0);
            if (0.1..1.0).contains(&vector.length()) {
                return vector.normalize().as_vec3().as_dvec3();
            }
        }
    }
}

/// `samples` samples on `rays` rays, some of them empty. Positions lie in the box, steps in 0.01..0.3, targets and
/// backgrounds in 0..1. Every third ray has no known depth; distances are from the origin of box space.
pub fn random_batch(random: &mut Random, rays: usize, samples: usize) -> Vec<TrainingRay> {
    let mut counts = vec![0; rays];
    // The first and every seventh ray stay empty, unless it is the only one.
    let filled: Vec<usize> = (0..rays).filter(|ray| rays == 1 || ray % 7 != 0).collect();
    for sample in 0..if filled.is_empty() { 0 } else { samples } {
        counts[filled[sample * sample % filled.len()]] += 1;
    }
    let sample = |random: &mut Random, direction: DVec3| {
        let position = random.vector(0.0, 1.0);
        let (delta, distance) = (random.number(0.01, 0.3), position.dot(direction));
        RaySample { position, delta, gains: [1.0; 2], distance }
    };
    (counts.into_iter().enumerate())
        .map(|(ray, count)| {
            let direction = random.direction();
            TrainingRay {
                direction,
                samples: (0..count).map(|_| sample(random, direction)).collect(),
                target: random.vector(0.0, 1.0).extend(random.number(0.0, 1.0)).to_array(),
                background: random.vector(0.0, 1.0).to_array(),
                depth: if ray % 3 == 2 { 0.0 } else { f64::from(random.number(0.1, 1.5) as f32) },
            }
        })
        .collect()
}
