//! `log.jsonl` as it was left: every field may be missing, the last line may be torn.

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::io::ErrorKind;
use std::path::Path;

/// The rows of a log.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// Beginnings of the training, one per run of `nerf train`.
    pub starts: Vec<Start>,
    /// Blocks of steps.
    pub steps: Vec<Steps>,
    /// Measurements of test views.
    pub evaluations: Vec<Evaluation>,
    /// The last measurement of the stages of a step.
    pub stages: Option<Stages>,
    /// Lines that are not understood: torn by a crash, or not of this program.
    pub damaged: usize,
}

/// The beginning of a run.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Start {
    /// Steps taken before.
    pub step: u64,
    /// The adapter's name.
    pub adapter: Option<String>,
    /// Its driver and version.
    pub driver: Option<String>,
    /// Parts that were not linked, and why.
    pub left_out: Vec<String>,
    /// Seconds of loading images.
    pub load_seconds: Option<f64>,
    /// Seconds of compiling kernels and of preparing the field.
    pub compile_seconds: Option<f64>,
}

/// A block of steps.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Steps {
    /// Steps taken, this block included.
    pub step: u64,
    /// Seconds of training, this block included.
    pub seconds: Option<f64>,
    /// Mean loss.
    pub loss: Option<f64>,
    /// PSNR of the rays trained on, in decibels.
    pub psnr: Option<f64>,
    /// Rays of the block.
    pub rays: Option<f64>,
    /// Samples of the block with colour and gradients.
    pub samples: Option<f64>,
    /// Marched samples of the block.
    pub marched: Option<f64>,
    /// The learning rate at its end.
    pub learning_rate: Option<f64>,
    /// Steps of the block whose gradients could not be used.
    pub skipped: u64,
}

/// A measurement of test views.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Evaluation {
    /// Steps taken.
    pub step: u64,
    /// Seconds of training.
    pub seconds: Option<f64>,
    /// Mean of the views' PSNRs, in decibels.
    pub eval_psnr: Option<f64>,
    /// Mean of the views' SSIMs.
    pub eval_ssim: Option<f64>,
    /// Seconds that the measurement took.
    pub eval_seconds: Option<f64>,
    /// Number of views.
    pub views: u64,
    /// Number of test views that were not measured at the end, because it would have taken too long.
    pub views_left_out: u64,
    /// Part of the pixels with a surface right before the camera.
    pub near_share: Option<f64>,
}

/// Where the time of a step goes.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Stages {
    /// Steps taken.
    pub step: u64,
    /// Steps that were timed.
    pub steps: u64,
    /// The stages, the longest first.
    pub stages: Vec<Stage>,
}

/// One stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Stage {
    /// Its name.
    pub stage: String,
    /// Milliseconds per step on the device.
    pub ms: f64,
}

/// What happened from one row to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval<'a> {
    /// The row at its end.
    pub row: &'a Steps,
    /// Steps in it, at least one.
    pub steps: f64,
    /// Seconds in it, more than zero.
    pub elapsed: f64,
}

impl Log {
    /// Reads a log; one that does not exist is empty.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn read(path: &Path) -> Result<Self> {
        match std::fs::read(path) {
            Ok(bytes) => Ok(Self::parse(&String::from_utf8_lossy(&bytes))),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(Self::default()),
            Err(error) => Err(error).with_context(|| format!("reading {}", path.display())),
        }
    }

    /// The rows of a log's text; rows of kinds that are not known are passed over.
    #[must_use]
    pub fn parse(text: &str) -> Self {
        let mut log = Self::default();
        for line in text.lines().filter(|line| !line.trim().is_empty()) {
            if log.add(line).is_err() {
                log.damaged += 1;
            }
        }
        log
    }

    fn add(&mut self, line: &str) -> Result<()> {
        let row: Value = serde_json::from_str(line)?;
        row.as_object().context("a row is an object")?;
        match row["event"].as_str() {
            Some("start") => self.starts.push(serde_json::from_value(row)?),
            Some("stages") => self.stages = Some(serde_json::from_value(row)?),
            Some(_) => {}
            None if row.get("eval_psnr").is_some() => self.evaluations.push(serde_json::from_value(row)?),
            None if row.get("step").is_some() => self.steps.push(serde_json::from_value(row)?),
            None => {}
        }
        Ok(())
    }

    /// Steps whose gradients could not be used.
    #[must_use]
    pub fn skipped(&self) -> u64 {
        self.steps.iter().fold(0, |sum, row| sum.saturating_add(row.skipped))
    }

    /// The rows with what lies between them. The first row counts where the log tells the beginning.
    pub fn intervals(&self) -> impl Iterator<Item = Interval<'_>> {
        let is_whole = self.starts.first().is_some_and(|start| start.step == 0);
        let begin = is_whole.then_some((0, Some(0.0)));
        let ends = begin.into_iter().chain(self.steps.iter().map(|row| (row.step, row.seconds)));
        let rows = self.steps.iter().skip(usize::from(!is_whole));
        ends.zip(rows).filter_map(|((step, seconds), row)| {
            let steps = row.step.checked_sub(step).filter(|steps| *steps > 0)? as f64;
            let elapsed = row.seconds? - seconds?;
            (elapsed > 0.0).then_some(Interval { row, steps, elapsed })
        })
    }

    /// Samples with colour and gradients per second of training. `None` when nothing was counted.
    #[must_use]
    pub fn samples_per_second(&self) -> Option<f64> {
        let counted = self.intervals().filter_map(|interval| Some((interval.row.samples?, interval.elapsed)));
        let (samples, seconds) = counted.fold((0.0, 0.0), |sum, (n, s)| (sum.0 + n, sum.1 + s));
        (seconds > 0.0).then(|| samples / seconds)
    }

    /// The last evaluation at the end of a training: one with SSIM.
    #[must_use]
    pub fn result(&self) -> Option<&Evaluation> {
        self.evaluations.iter().rev().find(|row| row.eval_ssim.is_some())
    }
}
