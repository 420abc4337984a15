//! The course of a training: blocks of steps, and between them reports, measurements and checkpoints.

use super::log::Log;
use super::pace::{Block, Pace};
use crate::commands::exam::Exam;
use crate::commands::scores::Means;
use crate::progress::{Progress, duration, short};
use crate::remarks::Remarks;
use anyhow::{Context, Result, anyhow};
use nerf::config::schedule::Budget;
use nerf::field::checkpoint::{About, Checkpoint};
use nerf::support::metrics::PSNR_CAP_DB;
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Seconds of training between checkpoints.
const BETWEEN_CHECKPOINTS: f64 = 60.0;

/// A training under way.
#[derive(Debug)]
pub(super) struct Course<'a> {
    about: &'a About,
    pace: Pace,
    /// Where the rows go.
    pub(super) log: Log,
    checkpoint: PathBuf,
    /// Measures test views.
    pub(super) exam: Option<Exam<'a>>,
    /// Steps between measurements.
    pub(super) eval_every: Option<u32>,
    remarks: Remarks,
    /// Step and seconds at the beginning of this run.
    start: (u32, f64),
    /// Step and seconds of the newest checkpoint; step 0 when there is none.
    saved: (u32, f64),
    /// The first and the last loss of this run.
    loss: Option<[f64; 2]>,
    is_empty: bool,
}

/// How a training ended.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    /// Steps taken, those of earlier runs included.
    pub(super) step: u32,
    /// Seconds of training, those of earlier runs included.
    pub(super) seconds: f64,
    /// The first and the last loss of this run; `None` when no step was taken.
    pub(super) loss: Option<[f64; 2]>,
    /// Steps of this run whose gradients could not be used.
    pub(super) skipped: u32,
    /// Whether it was asked to stop before its end.
    pub(super) interrupted: bool,
}

impl<'a> Course<'a> {
    /// A training that stands where `about` says.
    pub(super) fn new(about: &'a About, pace: Pace, log: Log, checkpoint: PathBuf, remarks: Remarks) -> Self {
        let start = (pace.steps(), pace.seconds());
        Self {
            about,
            pace,
            log,
            checkpoint,
            exam: None,
            eval_every: None,
            remarks,
            start,
            saved: start,
            loss: None,
            is_empty: false,
        }
    }

    /// Trains until the budget is spent or Ctrl-C is pressed, and saves.
    pub(super) fn run(&mut self) -> Result<End> {
        let stop = stop_on_interrupt()?;
        let progress = Progress::new(self.remarks, "training");
        while !self.pace.is_over() && !stop.load(Ordering::Relaxed) {
            let step = self.pace.steps();
            let pause = Budget {
                steps: self.eval_every.map(|every| (step - step % every).saturating_add(every)),
                seconds: None,
            };
            let block = self.pace.block(pause).map_err(|error| anyhow!("{error:#}; {}", self.kept()))?;
            self.record(&block, &progress)?;
            self.measure_if_due(&progress)?;
            if self.pace.seconds() - self.saved.1 >= BETWEEN_CHECKPOINTS {
                self.save()?;
            }
        }
        self.save()?;
        let (step, seconds) = (self.pace.steps(), self.pace.seconds());
        let stages = self.pace.stages.per_step();
        if !stages.is_empty() {
            let steps = self.pace.stages.steps();
            self.log.write(&json!({ "event": "stages", "step": step, "steps": steps, "stages": stages }))?;
        }
        let skipped = self.pace.skipped();
        Ok(End { step, seconds, loss: self.loss, skipped, interrupted: !self.pace.is_over() })
    }

    /// Logs a block and shows how far the training is.
    fn record(&mut self, block: &Block, progress: &Progress) -> Result<()> {
        let (step, seconds, stats) = (self.pace.steps(), self.pace.seconds(), &block.stats);
        let is_relative = self.pace.trainer.plan().has_relative_loss();
        let psnr = (!is_relative).then(|| (-10.0 * stats.color_error.log10()).min(PSNR_CAP_DB));
        self.loss = Some([self.loss.map_or(stats.loss, |[first, _]| first), stats.loss]);
        if stats.samples == 0 && !self.is_empty {
            progress.say(&format!(
                "warning: at step {step} the rays meet nothing any more, the field has become empty; try a smaller \
                 optimizer.learning_rate, occupancy.threshold or loss.sparsity"
            ));
        }
        self.is_empty = stats.samples == 0;
        if stats.skipped > 0 && self.pace.skipped() == stats.skipped {
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
            "learning_rate": self.pace.learning_rate(),
        }))?;
        let spent = self.pace.spent();
        progress.update(spent, || {
            let per_second = |count: u64| short(count as f64 / block.seconds.max(1e-9));
            let earlier = self.about.budget.spent(self.start.0, self.start.1);
            let remaining = (seconds - self.start.1) * (1.0 - spent) / (spent - earlier).max(1e-9);
            format!(
                "step {step}, loss {:.5}, {}, {} rays/s, {} samples/s, {}, {} to go",
                stats.loss,
                psnr.map_or_else(
                    || format!("relative error {:.1} %", 100.0 * stats.color_error.sqrt()),
                    |psnr| format!("PSNR {psnr:.2} dB")
                ),
                per_second(stats.rays),
                per_second(stats.samples),
                duration(seconds),
                duration(remaining)
            )
        });
        Ok(())
    }

    fn measure_if_due(&mut self, progress: &Progress) -> Result<()> {
        let step = self.pace.steps();
        let Some(exam) = &mut self.exam else { return Ok(()) };
        if self.eval_every.is_none_or(|every| !step.is_multiple_of(every)) {
            return Ok(());
        }
        let clock = Instant::now();
        let Some(Means { psnr, views, near_share, .. }) = exam.few()? else { return Ok(()) };
        progress.say(&format!("step {step}: PSNR {psnr:.2} dB over {views} test views"));
        self.log.write(&json!({
            "step": step,
            "seconds": self.pace.seconds(),
            "eval_psnr": psnr,
            "eval_seconds": clock.elapsed().as_secs_f64(),
            "views": views,
            "near_share": near_share,
        }))
    }

    fn save(&mut self) -> Result<()> {
        let state = self.pace.trainer.state()?;
        let (step, rays, step_excess) = (state.step, state.rays, state.step_excess);
        // No two runs take the same time; the log has it.
        let seconds = if self.about.config.deterministic { 0.0 } else { self.pace.seconds() };
        let about = About { step, rays, step_excess, seconds, ..self.about.clone() };
        let checkpoint = Checkpoint { about, state };
        checkpoint.save(&self.checkpoint).with_context(|| format!("at step {step} ({})", self.kept()))?;
        self.saved = (step, self.pace.seconds());
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
