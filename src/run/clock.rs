//! The clock of a training run: the only owner of its seconds, and what follows from them.

use crate::config::Config;
use crate::config::schedule::Budget;
use crate::field::checkpoint::Metadata;
use std::sync::Arc;

/// Seconds of training, which pass while steps are taken and stand still otherwise, and the budget they are spent of.
#[derive(Clone, Debug)]
pub struct StepClock {
    budget: Budget,
    config: Arc<Config>,
    seconds: f64,
    seconds_per_step: f64,
}

impl StepClock {
    /// The clock of the run that `metadata` describes, whose log counts `logged` seconds: a deterministic run's checkpoint
    /// does not say how long it took, and a log may be lost or lag behind.
    #[must_use]
    pub fn new(metadata: &Metadata, logged: f64) -> Self {
        Self {
            budget: metadata.budget,
            config: Arc::clone(&metadata.config),
            seconds: metadata.seconds.max(logged),
            seconds_per_step: 0.0,
        }
    }

    /// Seconds of training so far, those of earlier sessions included.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// The seconds that a checkpoint may hold: 0 of a deterministic run, since no two runs take the same time. The log
    /// has them.
    #[must_use]
    pub fn recorded_seconds(&self) -> f64 {
        if self.config.deterministic { 0.0 } else { self.seconds }
    }

    /// The part of the budget that is spent after `step` steps, within `[0, 1]`.
    #[must_use]
    pub fn spent(&self, step: u32) -> f64 {
        self.budget.spent(step, self.seconds)
    }

    /// Whether the budget is spent after `step` steps.
    #[must_use]
    pub fn is_over(&self, step: u32) -> bool {
        self.budget.is_spent(step, self.seconds)
    }

    /// Seconds until the budget is spent if it goes on as since `start`, a number of steps and seconds.
    #[must_use]
    pub fn remaining(&self, step: u32, start: (u32, f64)) -> f64 {
        let (spent, earlier) = (self.spent(step), self.budget.spent(start.0, start.1));
        (self.seconds - start.1) * (1.0 - spent) / (spent - earlier).max(1e-9)
    }

    /// The learning rate of the step after `step` steps, where `elapsed` more seconds have passed.
    #[must_use]
    pub fn learning_rate(&self, step: u32, elapsed: f64) -> f64 {
        self.budget.learning_rate(&self.config.optimizer, step, self.seconds + elapsed)
    }

    /// The learning rate that the run began with.
    #[must_use]
    pub fn first_learning_rate(&self) -> f64 {
        self.config.optimizer.learning_rate
    }

    /// The steps to take before looking at the clock again: at least one and at most `most`, neither beyond the budget
    /// nor beyond `pause`.
    #[must_use]
    pub fn steps_until(&self, pause: Budget, step: u32, most: u32) -> u32 {
        let until = |end: Budget| end.block(step, self.seconds, self.seconds_per_step, most);
        until(self.budget).min(until(pause))
    }

    /// Whether no step was taken on it yet, so that nobody knows how long one takes.
    #[must_use]
    pub fn is_new(&self) -> bool {
        self.seconds_per_step <= 0.0
    }

    /// The steps that take `seconds` at the pace of the last ones: at least one and at most `most`.
    #[must_use]
    pub fn steps_within(&self, seconds: f64, most: u32) -> u32 {
        if self.is_new() { most } else { ((seconds / self.seconds_per_step) as u32).clamp(1, most) }
    }

    /// Lets `seconds` pass, in which `steps` steps were taken.
    pub fn pass(&mut self, seconds: f64, steps: u32) {
        self.seconds += seconds;
        self.seconds_per_step = seconds / f64::from(steps.max(1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(is_deterministic: bool) -> StepClock {
        StepClock {
            budget: Budget { steps: Some(100), seconds: Some(10.0) },
            config: Config { deterministic: is_deterministic, ..Config::default() }.into(),
            seconds: 2.0,
            seconds_per_step: 0.0,
        }
    }

    #[test]
    fn time_passes_with_steps() {
        let mut clock = clock(false);
        assert!(clock.is_new() && clock.steps_within(0.1, 16) == 16);
        assert_eq!(clock.steps_until(Budget { steps: Some(20), seconds: None }, 16, 16), 4);
        clock.pass(3.0, 2);
        assert_eq!((clock.seconds(), clock.spent(7)), (5.0, 0.5));
        assert_eq!(clock.steps_until(Budget::default(), 7, 16), 4, "5 seconds at 1.5 each");
        assert!((clock.remaining(7, (0, 2.0)) - 3.0 * 0.5 / 0.3).abs() < 1e-9);
        assert_eq!([clock.steps_within(4.0, 16), clock.steps_within(0.1, 16)], [2, 1], "at 1.5 seconds each");
        clock.pass(5.0, 2);
        assert!(clock.is_over(7) && !clock.is_new());
    }

    #[test]
    fn deterministic_checkpoints_tell_no_time() {
        assert_eq!((clock(true).recorded_seconds(), clock(true).seconds()), (0.0, 2.0));
        assert_eq!(clock(false).recorded_seconds(), 2.0);
    }
}
