//! What a training run is asked to be.

use crate::config::schedule::Budget;
use crate::config::{Background, Config};
use anyhow::Result;
use std::path::PathBuf;

/// Seconds of training on a CPU when nothing is said.
const CPU_SECONDS: f64 = 300.0;
/// Steps on a GPU when nothing is said.
const GPU_STEPS: u32 = 20_000;

/// What to train, and for how long. Everything that is not said follows the dataset and the adapter, or the run that is
/// resumed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrainOptions {
    /// The dataset's path, as it was given; checkpoints hold it.
    pub dataset: String,
    /// A JSON file with settings.
    pub config: Option<PathBuf>,
    /// Single settings, `key.path=value`, which win over the file's.
    pub set: Vec<String>,
    /// The seed of every random number.
    pub seed: Option<u32>,
    /// What lies behind transparent photos.
    pub background: Option<Background>,
    /// The same checkpoint bit for bit.
    pub deterministic: bool,
    /// The end, if one is given.
    pub budget: Budget,
}

/// When a run saves itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SavingOptions {
    /// Seconds of training between checkpoints.
    pub every: f64,
    /// Most checkpoints that stay, the newest among them.
    pub keep: usize,
}

impl Default for SavingOptions {
    /// Every minute, and the one before stays.
    fn default() -> Self {
        Self { every: 60.0, keep: 2 }
    }
}

/// When test views are measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EvaluationOptions {
    /// Steps between two measurements of a few test views.
    pub every: Option<u32>,
    /// What is measured at the end.
    pub at_end: EvaluationAtEnd,
}

/// Which test views are measured at the end of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EvaluationAtEnd {
    /// Evenly spaced ones, at least one, for at most a tenth of the training time; all of a deterministic run.
    #[default]
    Share,
    /// All.
    All,
    /// None.
    Nothing,
}

impl EvaluationOptions {
    /// How many of the test views, at most `few`, are measured while training; `None` where none are measured at all.
    pub(super) fn few(&self, few: usize) -> Option<usize> {
        let is_asked = self.every.is_some() || self.at_end != EvaluationAtEnd::Nothing;
        is_asked.then_some(if self.every.is_some() { few } else { 0 })
    }
}

impl TrainOptions {
    /// `config`, changed by the file, the single settings, and the seed, background and determinism.
    ///
    /// # Errors
    /// When the file cannot be read, or a setting is unknown or out of range; the message names it.
    pub fn configure(&self, mut config: Config) -> Result<Config> {
        if let Some(path) = &self.config {
            config.merge_file(path)?;
        }
        for assignment in &self.set {
            config.set(assignment)?;
        }
        config.seed = self.seed.unwrap_or(config.seed);
        config.background = self.background.unwrap_or(config.background);
        config.deterministic |= self.deterministic;
        config.validate()?;
        Ok(config)
    }

    /// The end asked for, else that of the earlier run, else one that suits the adapter.
    #[must_use]
    pub fn budget(&self, is_cpu: bool, earlier: Option<Budget>) -> Budget {
        let suitable = match is_cpu {
            true => Budget { steps: None, seconds: Some(CPU_SECONDS) },
            false => Budget { steps: Some(GPU_STEPS), seconds: None },
        };
        if self.budget == Budget::default() { earlier.unwrap_or(suitable) } else { self.budget }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_said_follows_the_earlier_run_or_the_adapter() {
        let earlier = Budget { steps: Some(7), seconds: None };
        let silent = TrainOptions::default();
        assert_eq!(silent.budget(true, Some(earlier)), earlier);
        assert_eq!(silent.budget(true, None).seconds, Some(CPU_SECONDS));
        assert_eq!(silent.budget(false, None).steps, Some(GPU_STEPS));
        let asked = Budget { steps: None, seconds: Some(1.0) };
        assert_eq!(TrainOptions { budget: asked, ..silent }.budget(false, Some(earlier)), asked);
    }

    #[test]
    fn later_settings_win() {
        let set = vec!["seed=3".to_owned(), "grid.levels=8".to_owned()];
        let options = TrainOptions { set, seed: Some(5), deterministic: true, ..TrainOptions::default() };
        let config = options.configure(Config::default()).expect("valid");
        assert_eq!((config.seed, config.grid.levels, config.deterministic), (5, 8, true));
        let unknown = TrainOptions { set: vec!["grid.nothing=1".to_owned()], ..TrainOptions::default() };
        assert!(unknown.configure(Config::default()).is_err());
    }
}
