//! How much a step or a round of a view has room for.

use super::viewing::Rounds;
use crate::config::Batch;

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
    /// That of a training's steps. Half as many kept samples again as are aimed at, since the number of rays follows it
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
