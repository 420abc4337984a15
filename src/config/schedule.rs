//! How long a training run lasts, and the learning rate along the way.

use crate::config::Optimizer;
use anyhow::{Result, ensure};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// The end of a training run: a number of steps, of seconds, or whichever comes first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Budget {
    /// Steps from the very first one on.
    pub steps: Option<u32>,
    /// Seconds of training: without loading, compiling, evaluating and saving.
    pub seconds: Option<f64>,
}

impl Budget {
    /// Checks that there is an end.
    ///
    /// # Errors
    /// When nothing is given, or not a time.
    pub fn validate(&self) -> Result<()> {
        ensure!(
            self.steps.is_some() || self.seconds.is_some(),
            "a training run needs a number of steps or seconds"
        );
        ensure!(
            self.seconds.is_none_or(|seconds| seconds.is_finite() && seconds >= 0.0),
            "expected a number of seconds from 0 on, found {:?}",
            self.seconds.unwrap_or_default()
        );
        Ok(())
    }

    /// The part of the run that is over after `step` steps and `seconds`, within `[0, 1]`.
    #[must_use]
    pub fn spent(&self, step: u32, seconds: f64) -> f64 {
        let part = |done: f64, all: f64| if all > 0.0 { (done / all).min(1.0) } else { 1.0 };
        let of_steps = self.steps.map_or(0.0, |steps| part(f64::from(step), f64::from(steps)));
        let of_seconds = self.seconds.map_or(0.0, |all| part(seconds, all));
        of_steps.max(of_seconds)
    }

    /// Whether the run is over.
    #[must_use]
    pub fn is_spent(&self, step: u32, seconds: f64) -> bool {
        self.spent(step, seconds) >= 1.0
    }

    /// The steps to take before looking at the clock again: at most `most`, at least 1.
    #[must_use]
    pub fn block(&self, step: u32, seconds: f64, seconds_per_step: f64, most: u32) -> u32 {
        let of_steps = self.steps.map_or(most, |steps| steps.saturating_sub(step));
        let of_seconds = match self.seconds {
            Some(all) if seconds_per_step > 0.0 => ((all - seconds) / seconds_per_step).ceil(),
            _ => f64::from(most),
        };
        most.min(of_steps).min(of_seconds.clamp(0.0, f64::from(most)) as u32).max(1)
    }

    /// Adam's learning rate: a cosine from the first to the last over the budget.
    #[must_use]
    pub fn learning_rate(&self, optimizer: &Optimizer, step: u32, seconds: f64) -> f64 {
        let (first, last) = (optimizer.learning_rate, optimizer.final_learning_rate);
        last + (first - last) * 0.5 * (1.0 + (PI * self.spent(step, seconds)).cos())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOTH: Budget = Budget { steps: Some(100), seconds: Some(10.0) };

    #[test]
    fn whichever_comes_first_ends_it() {
        assert_eq!(BOTH.spent(50, 1.0), 0.5);
        assert_eq!(BOTH.spent(10, 9.0), 0.9);
        assert!(BOTH.is_spent(100, 0.0) && BOTH.is_spent(0, 10.5) && !BOTH.is_spent(99, 9.9));
        assert!(Budget { steps: Some(0), seconds: None }.is_spent(0, 0.0));
    }

    #[test]
    fn the_learning_rate_follows_a_cosine() {
        let optimizer = Optimizer { learning_rate: 3.0, final_learning_rate: 1.0, ..Optimizer::default() };
        let rate = |step| BOTH.learning_rate(&optimizer, step, 0.0);
        assert_eq!((rate(0), rate(100), rate(200)), (3.0, 1.0, 1.0));
        assert!((rate(50) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn blocks_end_with_the_budget() {
        assert_eq!(BOTH.block(0, 0.0, 0.0, 16), 16);
        assert_eq!(BOTH.block(95, 0.0, 0.01, 16), 5);
        assert_eq!(BOTH.block(0, 9.5, 0.1, 16), 5);
        assert_eq!(BOTH.block(0, 9.99, 1.0, 16), 1);
    }

    #[test]
    fn a_budget_without_end_is_refused() {
        assert!(BOTH.validate().is_ok());
        assert!(Budget::default().validate().is_err());
        assert!(Budget { steps: None, seconds: Some(f64::NAN) }.validate().is_err());
        assert!(Budget { steps: None, seconds: Some(-1.0) }.validate().is_err());
    }
}
