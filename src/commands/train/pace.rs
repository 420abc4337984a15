//! A training against the clock: blocks of steps, each of which ends with a wait for the device.

use super::stages::StageTimes;
use anyhow::{Result, bail};
use nerf::config::Optimizer;
use nerf::config::schedule::Budget;
use nerf::field::checkpoint::About;
use nerf::field::train::{StepStats, Trainer};
use std::time::Instant;

/// Most steps of a block.
const BLOCK: u32 = 16;
/// A training ends when so many steps in a row had gradients that could not be used.
const MOST_SKIPPED: u32 = 16;

/// A trainer, its budget and its clock, which runs during blocks only.
#[derive(Debug)]
pub(in crate::commands) struct Pace {
    /// Takes the steps.
    pub(in crate::commands) trainer: Trainer,
    /// Where the time went.
    pub(in crate::commands) stages: StageTimes,
    budget: Budget,
    optimizer: Optimizer,
    seconds: f64,
    seconds_per_step: f64,
    /// Skipped steps, and how many of them came last.
    skipped: (u32, u32),
}

/// Some steps in a row.
#[derive(Clone, Copy, Debug)]
pub(in crate::commands) struct Block {
    /// What happened in them.
    pub(in crate::commands) stats: StepStats,
    /// How long they took.
    pub(in crate::commands) seconds: f64,
}

impl Pace {
    /// A training to `about`'s budget, `seconds` of which were spent earlier.
    pub(in crate::commands) fn new(about: &About, trainer: Trainer, seconds: f64) -> Self {
        Self {
            stages: StageTimes::new(trainer.gpu()),
            trainer,
            budget: about.budget,
            optimizer: about.config.optimizer.clone(),
            seconds,
            seconds_per_step: 0.0,
            skipped: (0, 0),
        }
    }

    /// Steps taken, those of earlier runs included.
    pub(in crate::commands) fn steps(&self) -> u32 {
        self.trainer.steps()
    }

    /// Seconds of training so far, those of earlier runs included.
    pub(in crate::commands) fn seconds(&self) -> f64 {
        self.seconds
    }

    /// The part of the budget that is spent, within `[0, 1]`.
    pub(in crate::commands) fn spent(&self) -> f64 {
        self.budget.spent(self.steps(), self.seconds)
    }

    /// Whether the budget is spent.
    pub(in crate::commands) fn is_over(&self) -> bool {
        self.budget.is_spent(self.steps(), self.seconds)
    }

    /// The learning rate of the next step.
    pub(in crate::commands) fn learning_rate(&self) -> f64 {
        self.budget.learning_rate(&self.optimizer, self.steps(), self.seconds)
    }

    /// Steps so far whose gradients could not be used.
    pub(in crate::commands) fn skipped(&self) -> u32 {
        self.skipped.0
    }

    /// Takes at least one and at most [`BLOCK`] steps, neither beyond the budget nor beyond `pause`, and waits.
    ///
    /// # Errors
    /// When the training leads nowhere any more, or the device was lost.
    pub(in crate::commands) fn block(&mut self, pause: Budget) -> Result<Block> {
        let (first, budget) = (self.trainer.steps(), self.budget);
        let until = |end: Budget| end.block(first, self.seconds, self.seconds_per_step, BLOCK);
        let count = until(budget).min(until(pause));
        let mut stages = self.stages.of_block(first / BLOCK);
        let clock = Instant::now();
        for step in first..first + count {
            let seconds = self.seconds + clock.elapsed().as_secs_f64();
            let timer = stages.as_mut().and_then(|stages| stages.of_step());
            self.trainer.step(budget.learning_rate(&self.optimizer, step, seconds), timer)?;
        }
        let stats = self.trainer.report()?;
        let seconds = clock.elapsed().as_secs_f64();
        self.seconds += seconds;
        self.seconds_per_step = seconds / f64::from(count);
        self.check(&stats)?;
        Ok(Block { stats, seconds })
    }

    /// Ends a training that leads nowhere any more.
    fn check(&mut self, stats: &StepStats) -> Result<()> {
        let in_a_row = if stats.skipped == stats.steps { self.skipped.1 + stats.skipped } else { 0 };
        self.skipped = (self.skipped.0 + stats.skipped, in_a_row);
        let found = match stats.loss {
            _ if in_a_row >= MOST_SKIPPED => {
                format!("the gradients of the last {in_a_row} steps were not finite or far too large")
            }
            loss if !(loss.is_finite() && stats.color_error.is_finite()) => {
                format!("the loss is not finite any more ({loss})")
            }
            _ => return Ok(()),
        };
        bail!(
            "{found} at step {}: the training diverged; start again with a smaller optimizer.learning_rate ({} was \
             used)",
            self.trainer.steps(),
            self.optimizer.learning_rate
        )
    }
}
