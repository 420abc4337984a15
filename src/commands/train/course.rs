//! The course of a training: blocks of steps, and between them reports, measurements and checkpoints.

use super::log::Log;
use super::stages::StageTimes;
use crate::commands::scores::{Judge, Means};
use crate::progress::{Progress, duration, short};
use crate::remarks::Remarks;
use anyhow::{Context, Result, bail};
use nerf::checkpoint::{About, Checkpoint};
use nerf::image::Image;
use nerf::metrics::PSNR_CAP_DB;
use nerf::train::{StepStats, Trainer};
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Steps between reports, each of which waits for the device.
const BLOCK: u32 = 16;
/// A training ends when so many steps in a row had gradients that could not be used.
const MOST_SKIPPED: u32 = 16;
/// Seconds of training between checkpoints.
const BETWEEN_CHECKPOINTS: f64 = 60.0;

/// A training under way.
#[derive(Debug)]
pub(super) struct Course<'a> {
    about: &'a About,
    trainer: Trainer,
    /// Where the rows go.
    pub(super) log: Log,
    checkpoint: PathBuf,
    /// Measures test views.
    pub(super) exam: Option<Exam<'a>>,
    remarks: Remarks,
    /// Seconds of training so far.
    seconds: f64,
    /// Step and seconds at the beginning of this run.
    start: (u32, f64),
    /// Step and seconds of the newest checkpoint; step 0 when there is none.
    saved: (u32, f64),
    loss: Option<f64>,
    is_empty: bool,
    /// Skipped steps, and how many of them came last.
    skipped: (u32, u32),
    stages: StageTimes,
}

/// Measures a few test views every so many steps.
#[derive(Debug)]
pub(super) struct Exam<'a> {
    /// Renders and compares.
    pub(super) judge: Judge<'a>,
    /// Steps between measurements.
    pub(super) every: Option<u32>,
    /// The frames and their photos.
    pub(super) few: Vec<(usize, Image)>,
}

/// How a training ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    /// Steps taken, those of earlier runs included.
    pub(super) step: u32,
    /// Seconds of training, those of earlier runs included.
    pub(super) seconds: f64,
    /// The last loss; `None` when no step was taken.
    pub(super) loss: Option<f64>,
    /// Steps of this run whose gradients could not be used.
    pub(super) skipped: u32,
    /// Whether it was asked to stop before its end.
    pub(super) interrupted: bool,
}

impl<'a> Course<'a> {
    /// A training that stands where `about` says.
    pub(super) fn new(
        about: &'a About,
        trainer: Trainer,
        log: Log,
        checkpoint: PathBuf,
        remarks: Remarks,
    ) -> Self {
        // A deterministic training's checkpoint does not tell.
        let seconds = about.seconds.max(log.seconds);
        let start = (about.step, seconds);
        let stages = StageTimes::new(trainer.gpu());
        Self {
            about,
            trainer,
            log,
            checkpoint,
            exam: None,
            remarks,
            seconds,
            start,
            saved: start,
            loss: None,
            is_empty: false,
            skipped: (0, 0),
            stages,
        }
    }

    /// Trains until the budget is spent or Ctrl-C is pressed, and saves.
    pub(super) fn run(&mut self) -> Result<End> {
        let stop = stop_on_interrupt()?;
        let progress = Progress::new(self.remarks, "training");
        let budget = self.about.budget;
        let mut seconds_per_step = 0.0;
        while !budget.is_spent(self.trainer.steps(), self.seconds) && !stop.load(Ordering::Relaxed) {
            let before = (self.trainer.steps(), self.seconds);
            let stats = self.block(seconds_per_step)?;
            let taken = self.trainer.steps() - before.0;
            let elapsed = self.seconds - before.1;
            seconds_per_step = elapsed / f64::from(taken.max(1));
            self.record(&stats, elapsed, &progress)?;
            self.measure_if_due(&progress)?;
            if self.seconds - self.saved.1 >= BETWEEN_CHECKPOINTS {
                self.save()?;
            }
        }
        self.save()?;
        let step = self.trainer.steps();
        if let Some(row) = self.stages.row(step) {
            self.log.write(&row)?;
        }
        let interrupted = !budget.is_spent(step, self.seconds);
        Ok(End { step, seconds: self.seconds, loss: self.loss, skipped: self.skipped.0, interrupted })
    }

    /// Takes up to [`BLOCK`] steps and waits for them.
    fn block(&mut self, seconds_per_step: f64) -> Result<StepStats> {
        let (budget, optimizer) = (self.about.budget, &self.about.config.optimizer);
        let first = self.trainer.steps();
        let mut count = budget.block(first, self.seconds, seconds_per_step, BLOCK);
        if let Some(every) = self.exam.as_ref().and_then(|exam| exam.every) {
            count = count.min(every - first % every);
        }
        let mut stages = self.stages.of_block(first / BLOCK);
        let clock = Instant::now();
        for step in first..first + count {
            let seconds = self.seconds + clock.elapsed().as_secs_f64();
            let timer = stages.as_mut().and_then(|stages| stages.of_step());
            self.trainer.step(budget.learning_rate(optimizer, step, seconds), timer)?;
        }
        let stats = self.trainer.report()?;
        self.seconds += clock.elapsed().as_secs_f64();
        self.check(&stats)?;
        Ok(stats)
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
             used); {}",
            self.trainer.steps(),
            self.about.config.optimizer.learning_rate,
            self.kept()
        )
    }

    /// Logs a block and shows how far the training is.
    fn record(&mut self, stats: &StepStats, elapsed: f64, progress: &Progress) -> Result<()> {
        let (step, seconds, budget) = (self.trainer.steps(), self.seconds, self.about.budget);
        let psnr = (-10.0 * stats.color_error.log10()).min(PSNR_CAP_DB);
        self.loss = Some(stats.loss);
        if stats.samples == 0 && !self.is_empty {
            progress.say(&format!(
                "warning: at step {step} the rays meet nothing any more, the field has become empty; try a smaller \
                 optimizer.learning_rate or occupancy.threshold"
            ));
        }
        self.is_empty = stats.samples == 0;
        if stats.skipped > 0 && self.skipped.0 == stats.skipped {
            progress.say(&format!(
                "warning: up to step {step}, {} steps were skipped: their gradients were not finite or far too large; \
                 if it goes on, try a smaller optimizer.learning_rate",
                stats.skipped
            ));
        }
        self.log.write(&json!({
            "step": step,
            "seconds": seconds,
            "loss": stats.loss,
            "psnr": psnr,
            "rays": stats.rays,
            "samples": stats.samples,
            "marched": stats.marched,
            "skipped": stats.skipped,
            "learning_rate": budget.learning_rate(&self.about.config.optimizer, step, seconds),
        }))?;
        let spent = budget.spent(step, seconds);
        progress.update(spent, || {
            let per_second = |count: u64| short(count as f64 / elapsed.max(1e-9));
            let earlier = budget.spent(self.start.0, self.start.1);
            let remaining = (seconds - self.start.1) * (1.0 - spent) / (spent - earlier).max(1e-9);
            format!(
                "step {step}, loss {:.5}, PSNR {psnr:.2} dB, {} rays/s, {} samples/s, {}, {} to go",
                stats.loss,
                per_second(stats.rays),
                per_second(stats.samples),
                duration(seconds),
                duration(remaining)
            )
        });
        Ok(())
    }

    fn measure_if_due(&mut self, progress: &Progress) -> Result<()> {
        let step = self.trainer.steps();
        let Some(exam) = &mut self.exam else { return Ok(()) };
        if exam.every.is_none_or(|every| !step.is_multiple_of(every)) {
            return Ok(());
        }
        let mut scores = Vec::new();
        for (index, image) in &exam.few {
            scores.push(exam.judge.score(*index, image)?.0);
        }
        let Some(Means { psnr, views, .. }) = Means::of(&scores) else { return Ok(()) };
        progress.say(&format!("step {step}: PSNR {psnr:.2} dB over {views} test views"));
        let row = json!({ "step": step, "seconds": self.seconds, "eval_psnr": psnr, "views": views });
        self.log.write(&row)
    }

    fn save(&mut self) -> Result<()> {
        let state = self.trainer.state()?;
        let (step, rays) = (state.step, state.rays);
        // No two runs take the same time; the log has it.
        let seconds = if self.about.config.deterministic { 0.0 } else { self.seconds };
        let about = About { step, rays, seconds, ..self.about.clone() };
        let checkpoint = Checkpoint { about, state };
        checkpoint.save(&self.checkpoint).with_context(|| format!("at step {step} ({})", self.kept()))?;
        self.saved = (step, self.seconds);
        Ok(())
    }

    /// What there is to go on with.
    fn kept(&self) -> String {
        match self.saved.0 {
            0 => "nothing was saved yet".to_owned(),
            step => format!("the checkpoint of step {step} is kept"),
        }
    }
}

/// A flag that Ctrl-C raises; pressed again, it ends the program at once.
fn stop_on_interrupt() -> Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        if raised.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    })
    .context("listening for Ctrl-C")?;
    Ok(stop)
}
