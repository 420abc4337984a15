//! One run, measured at times that are evenly spaced on a logarithmic axis.

use crate::commands::Session;
use crate::narrator::Narrator;
use crate::progress::{Progress, duration};
use anyhow::{Context, Result};
use nerf::config::schedule::Budget;
use nerf::run::log::StageTime;
use nerf::run::{Evaluator, Means, Stepper};
use serde::Serialize;

/// Seconds of training up to the first measurement.
const FIRST: f64 = 0.1;
/// The loss is noted whenever this much more time was trained.
const BETWEEN_LOSSES: f64 = 1.1;

/// What was measured of one run.
#[derive(Serialize)]
pub(super) struct Curve {
    /// Steps taken.
    pub(super) steps: u32,
    /// Seconds of training: without loading, compiling and measuring.
    pub(super) seconds: f64,
    /// Kept samples, those with colour and gradients, per second of training.
    pub(super) samples_per_second: f64,
    /// Over all test views at the end.
    pub(super) psnr: f64,
    /// Over all test views at the end.
    pub(super) ssim: f64,
    /// Number of test views.
    pub(super) views: usize,
    /// Steps whose stages were timed: those of one block in sixteen. They are part of the run, and wait for the
    /// device each, which costs a little.
    pub(super) timed_steps: u32,
    /// The time of each stage in those steps; none where the adapter has no timestamps.
    pub(super) stages: Vec<StageTime>,
    /// In the order of time.
    pub(super) points: Vec<Point>,
}

/// A moment of a training run.
#[derive(Clone, Copy, Serialize)]
pub(super) struct Point {
    /// Steps taken.
    pub(super) step: u32,
    /// Seconds of training.
    pub(super) seconds: f64,
    /// Mean loss of the steps before, at most a block of them; `None` before the first one.
    pub(super) loss: Option<f64>,
    /// The test views, where they were measured.
    #[serde(flatten)]
    pub(super) measured: Option<Measured>,
}

/// What test views say.
#[derive(Clone, Copy, Serialize)]
pub(super) struct Measured {
    /// Mean over views.
    pub(super) eval_psnr: f64,
    /// Mean over views.
    pub(super) eval_ssim: f64,
    /// Number of views.
    pub(super) views: usize,
}

impl From<Means> for Measured {
    fn from(means: Means) -> Self {
        Self { eval_psnr: means.psnr, eval_ssim: means.ssim, views: means.views }
    }
}

/// Trains to the end of the budget. The few views are measured at 0.1, 0.2, 0.5, 1, 2, 5, … seconds, all of them at
/// the end; the clock of the run stands still meanwhile.
pub(super) fn follow(
    mut stepper: Stepper,
    evaluator: &mut Evaluator<'_>,
    test: &[usize],
    session: &Session<'_>,
) -> Result<Curve> {
    let progress = Progress::new(session.console, "training");
    let (mut points, mut samples) = (Vec::<Point>::new(), 0);
    let (mut next_mark, mut next_loss) = (FIRST, 0.0);
    let mut loss = None;
    while !stepper.is_over() {
        session.check_interrupt()?;
        let stats = stepper.block(Budget { steps: None, seconds: Some(next_mark) })?.stats;
        let (step, seconds) = (stepper.steps(), stepper.seconds());
        (loss, samples) = (Some(stats.loss), samples + stats.samples);
        let mut point = Point { step, seconds, loss, measured: None };
        if seconds >= next_mark && !stepper.is_over() {
            point.measured = evaluator.kept()?.map(Measured::from);
            while next_mark <= seconds {
                next_mark = after(next_mark);
            }
        }
        if point.measured.is_some() || seconds >= next_loss {
            points.push(point);
            next_loss = seconds * BETWEEN_LOSSES;
        }
        progress.update(stepper.spent(), || {
            let psnr =
                points.iter().rev().find_map(|point| point.measured).map(|measured| measured.eval_psnr);
            let psnr = psnr.map_or_else(String::new, |psnr| format!(", PSNR {psnr:.2} dB"));
            format!("step {step}, loss {:.5}{psnr}, {}", stats.loss, duration(seconds))
        });
    }
    drop(progress);
    let (step, seconds) = (stepper.steps(), stepper.seconds());
    let scores =
        evaluator.all(test, &mut Narrator::new(session.console))?.context("there are no test views")?;
    points.pop_if(|last| last.step == step);
    // The few once more, for the curve, and all of them.
    let few = scores.few.filter(|few| few.views < scores.all.views);
    let ends = few.into_iter().chain([scores.all]);
    points.extend(ends.map(|means| Point { step, seconds, loss, measured: Some(means.into()) }));
    Ok(Curve {
        steps: step,
        seconds,
        samples_per_second: samples as f64 / seconds.max(1e-9),
        psnr: scores.all.psnr,
        ssim: scores.all.ssim,
        views: scores.all.views,
        timed_steps: stepper.stages().steps(),
        stages: stepper.stages().per_step(),
        points,
    })
}

/// The next of 1, 2, 5, 10, 20, 50, …
fn after(mark: f64) -> f64 {
    let decade = 10f64.powf((mark * 1.01).log10().floor());
    let factor = (mark / decade).round();
    decade
        * if factor < 2.0 {
            2.0
        } else if factor < 5.0 {
            5.0
        } else {
            10.0
        }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_evenly_spaced() {
        let marks = std::iter::successors(Some(FIRST), |&mark| Some(after(mark)));
        let expected = [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0];
        for (mark, expected) in marks.zip(expected) {
            assert!((mark - expected).abs() < 1e-9, "{mark} {expected}");
        }
    }
}
