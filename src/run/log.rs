//! `log.jsonl`: its rows, which are written and read alike. In a log as it was left every key may be missing, and the last
//! line may be torn.

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize, Serializer};
use serde_json::Value;
use std::io::ErrorKind;
use std::path::Path;

/// A row of a log: one JSON object with the keys of its fields, in their order.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum LogRow {
    /// The beginning of a session, `"event": "start"`.
    Start(Start),
    /// Where the time of a step goes, `"event": "stages"`.
    Stages(Stages),
    /// A measurement of test views: what has `eval_psnr`, and no `event`.
    #[serde(untagged)]
    Evaluation(Evaluation),
    /// A block of steps: everything else that has `step`, and no `event`.
    #[serde(untagged)]
    Block(Steps),
}

/// The rows of a log.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Log {
    /// Beginnings of the run, one per session.
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

/// The beginning of a session.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
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
    #[serde(serialize_with = "whole")]
    pub rays: Option<f64>,
    /// Samples of the block with colour and gradients.
    #[serde(serialize_with = "whole")]
    pub samples: Option<f64>,
    /// Marched samples of the block.
    #[serde(serialize_with = "whole")]
    pub marched: Option<f64>,
    /// Steps of the block whose gradients could not be used.
    pub skipped: u64,
    /// The learning rate at its end.
    pub learning_rate: Option<f64>,
}

/// A measurement of test views.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Evaluation {
    /// Steps taken.
    pub step: u64,
    /// Seconds of training.
    pub seconds: Option<f64>,
    /// Mean of the views' PSNRs, in decibels.
    pub eval_psnr: Option<f64>,
    /// Mean of the views' SSIMs; only measured at the end.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub eval_ssim: Option<f64>,
    /// Seconds that the measurement took.
    pub eval_seconds: Option<f64>,
    /// Number of views.
    pub views: u64,
    /// Number of test views that were not measured at the end, because it would have taken too long.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub views_left_out: Option<u64>,
    /// Part of the pixels with a surface right before the camera.
    pub near_share: Option<f64>,
}

/// Where the time of a step goes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Stages {
    /// Steps taken.
    pub step: u64,
    /// Steps that were timed.
    pub steps: u64,
    /// The stages, the longest first.
    pub stages: Vec<StageTime>,
}

/// One stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StageTime {
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

/// Counts are kept as floats, which sums and quotients need, and written as the whole numbers that they are.
fn whole<S: Serializer>(count: &Option<f64>, to: S) -> Result<S::Ok, S::Error> {
    count.map(|count| count as u64).serialize(to)
}

impl LogRow {
    /// The row of a line; `None` where it is of a kind that is not known.
    ///
    /// # Errors
    /// When the line is torn, or a key's value is of another type.
    pub fn parse(line: &str) -> Result<Option<Self>> {
        let row: Value = serde_json::from_str(line)?;
        row.as_object().context("a row is an object")?;
        Ok(match row["event"].as_str() {
            Some("start") => Some(Self::Start(serde_json::from_value(row)?)),
            Some("stages") => Some(Self::Stages(serde_json::from_value(row)?)),
            Some(_) => None,
            None if row.get("eval_psnr").is_some() => Some(Self::Evaluation(serde_json::from_value(row)?)),
            None if row.get("step").is_some() => Some(Self::Block(serde_json::from_value(row)?)),
            None => None,
        })
    }
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
        match LogRow::parse(line)? {
            Some(LogRow::Start(row)) => self.starts.push(row),
            Some(LogRow::Stages(row)) => self.stages = Some(row),
            Some(LogRow::Evaluation(row)) => self.evaluations.push(row),
            Some(LogRow::Block(row)) => self.steps.push(row),
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

    /// The last evaluation at the end of a training run: one with SSIM.
    #[must_use]
    pub fn result(&self) -> Option<&Evaluation> {
        self.evaluations.iter().rev().find(|row| row.eval_ssim.is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rows as `log.jsonl` has had them from the first version on.
    const ROWS: [&str; 5] = [
        r#"{"event":"start","step":0,"adapter":"a","driver":"b","left_out":["c"],"load_seconds":0.5,"compile_seconds":2.0}"#,
        r#"{"step":16,"seconds":0.25,"loss":0.1,"psnr":null,"rays":4096,"samples":70000,"marched":80000,"skipped":0,"learning_rate":0.01}"#,
        r#"{"step":16,"seconds":0.25,"eval_psnr":20.5,"eval_seconds":0.1,"views":4,"near_share":null}"#,
        r#"{"step":16,"seconds":0.25,"eval_psnr":20.5,"eval_ssim":0.5,"eval_seconds":0.1,"views":4,"views_left_out":0,"near_share":0.01}"#,
        r#"{"event":"stages","step":16,"steps":2,"stages":[{"stage":"encode","ms":1.5}]}"#,
    ];

    #[test]
    fn rows_are_written_as_they_are_read() {
        for text in ROWS {
            let row = LogRow::parse(text).expect("whole").expect("known");
            assert_eq!(serde_json::to_string(&row).expect("JSON"), text);
        }
    }

    #[test]
    fn torn_and_unknown_rows_are_told_apart() {
        assert!(LogRow::parse(&ROWS[1][..30]).is_err() && LogRow::parse("[1]").is_err());
        assert_eq!(LogRow::parse(r#"{"event":"something new"}"#).expect("whole"), None);
        assert!(LogRow::parse(r#"{"event":"start","step":"many"}"#).is_err());
    }
}
