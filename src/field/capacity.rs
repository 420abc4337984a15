//! How much a step or a round of a view has room for.

use super::{Capabilities, SceneFeatures};
use crate::config::Batch;

/// Room behind the last sample for the rows that the last thread of a matrix product computes in vain.
pub const SPARE_ROWS: usize = 1024;

/// Room for rays and samples, which buffers are sized by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capacity {
    /// Most rays.
    pub rays: usize,
    /// Most marched samples.
    pub samples: usize,
    /// Most kept samples.
    pub kept: usize,
}

impl Capacity {
    /// That of training steps. Half as many kept samples again as are aimed at, since the number of rays follows it
    /// only from step to step.
    #[must_use]
    pub fn of_steps(batch: &Batch) -> Self {
        let Batch { rays, samples, kept, .. } = *batch;
        Self { rays, samples, kept: (kept / 2 * 3).min(samples) }
    }

    /// That of a view's rounds, in which every sample may get colour.
    #[must_use]
    pub fn of_rounds(rounds: &Rounds) -> Self {
        let samples = rounds.samples.max(rounds.rays);
        Self { rays: rounds.rays, samples, kept: samples }
    }
}

/// How much of a view is in work at once. Rays are marched front to back in rounds of a few samples; one that ended
/// makes room for the next pixel's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rounds {
    /// Rays in work.
    pub rays: usize,
    /// Samples of a round, at least one for each ray; fewer rays may ask for more each.
    pub samples: usize,
    /// Most samples of a ray in a round: those behind an opaque surface are computed in vain.
    pub most_quota: usize,
    /// Most pixels between two read-backs.
    pub band: usize,
    /// Samples get colour wherever the weights since the last one sum to this, and stand for those in between.
    pub color_weight: f64,
}

/// What does not show in 32 bits.
pub const LEAST_WEIGHT: f64 = 1e-12;

impl Rounds {
    /// What suits an adapter: few samples in vain on a CPU, few rounds on a GPU.
    pub(crate) fn suited_to(adapter: Capabilities) -> Self {
        if adapter.is_cpu {
            Self { rays: 1 << 13, samples: 1 << 15, most_quota: 16, band: 1 << 20, color_weight: 1e-3 }
        } else {
            // With what is behind the last sample, activations of 64 numbers take the 128 MiB that every adapter binds.
            let samples = (1 << 19) - SPARE_ROWS;
            Self { rays: samples / 8, samples, most_quota: 64, band: 1 << 21, color_weight: 1e-3 }
        }
    }

    /// The weight of a colour. Without a bound on the colours there is none on the error of one that stands for
    /// others: in linear light every sample has its own.
    pub(crate) fn color_weight(&self, features: &SceneFeatures) -> f64 {
        if features.hdr { LEAST_WEIGHT } else { self.color_weight }
    }
}
