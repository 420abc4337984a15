//! A trainer against the clock: blocks of steps, each of which ends with a wait for the device.

use super::clock::StepClock;
use super::stage_times::StageTimes;
use crate::config::schedule::Budget;
use crate::field::trainer::{StepStats, Trainer};
use crate::support::stopwatch::Stopwatch;
use anyhow::{Result, bail};

/// Most steps of a block.
const BLOCK: u32 = 16;
/// Seconds of a block at most, unless one step takes longer: so soon a wish to stop is heard.
const LONGEST_BLOCK: f64 = 1.0;
/// A run ends when so many steps in a row had gradients that could not be used.
const MOST_SKIPPED: u32 = 16;

/// A trainer and its clock, which runs during blocks only.
#[derive(Debug)]
pub struct Stepper {
    trainer: Trainer,
    clock: StepClock,
    watch: Stopwatch,
    stages: StageTimes,
    /// Skipped steps, and how many of them came last.
    skipped: (u32, u32),
}

/// Some steps in a row.
#[derive(Clone, Copy, Debug)]
pub struct Block {
    /// What happened in them.
    pub stats: StepStats,
    /// How long they took.
    pub seconds: f64,
}

impl Stepper {
    /// A trainer at the time of `clock`.
    #[must_use]
    pub fn new(trainer: Trainer, clock: StepClock) -> Self {
        let (watch, stages) = (Stopwatch::default(), StageTimes::new(trainer.gpu()));
        Self { trainer, clock, watch, stages, skipped: (0, 0) }
    }

    /// What takes the steps.
    #[must_use]
    pub fn trainer(&self) -> &Trainer {
        &self.trainer
    }

    /// The time, and what is left of it.
    #[must_use]
    pub fn clock(&self) -> &StepClock {
        &self.clock
    }

    /// Where the time went.
    #[must_use]
    pub fn stages(&self) -> &StageTimes {
        &self.stages
    }

    /// Steps taken, those of earlier sessions included.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.trainer.steps()
    }

    /// Seconds of training so far, those of earlier sessions included.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.clock.seconds()
    }

    /// The part of the budget that is spent, within `[0, 1]`.
    #[must_use]
    pub fn spent(&self) -> f64 {
        self.clock.spent(self.steps())
    }

    /// Whether the budget is spent.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.clock.is_over(self.steps())
    }

    /// Steps so far whose gradients could not be used.
    #[must_use]
    pub fn skipped(&self) -> u32 {
        self.skipped.0
    }

    /// Takes at least one and at most 16 steps, about a second of them, neither beyond the budget nor beyond `pause`, and
    /// waits.
    ///
    /// # Errors
    /// When training diverges, or the device was lost.
    pub fn block(&mut self, pause: Budget) -> Result<Block> {
        let first = self.steps();
        let mut count = self.clock.steps_until(pause, first, self.clock.steps_within(LONGEST_BLOCK, BLOCK));
        let mut stages = self.stages.of_block(first / BLOCK);
        let start = self.watch.seconds();
        let mut taken = 0;
        while taken < count {
            let elapsed = self.watch.seconds() - start;
            let learning_rate = self.clock.learning_rate(first + taken, elapsed);
            let timer = stages.as_mut().and_then(|stages| stages.of_step());
            self.trainer.step(learning_rate, timer)?;
            taken += 1;
            if taken == 1 && self.clock.is_new() {
                // Nobody knows yet how many fit.
                self.trainer.gpu().wait()?;
                let fitting = LONGEST_BLOCK / (self.watch.seconds() - start).max(1e-9);
                count = count.min(fitting as u32).max(1);
            }
        }
        let stats = self.trainer.report()?;
        let seconds = self.watch.seconds() - start;
        self.clock.pass(seconds, count);
        self.check(&stats)?;
        Ok(Block { stats, seconds })
    }

    /// Ends a run that diverges.
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
            "{found} at step {}: training diverged; start again with a smaller optimizer.learning_rate ({} was \
             used)",
            self.trainer.steps(),
            self.clock.first_learning_rate()
        )
    }
}
