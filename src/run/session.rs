//! The session of a training run: photos and kernels, blocks of steps, and between them measurements, the log and
//! checkpoints.

mod ending;
mod saving;

use super::clock::StepClock;
use super::disk;
use super::evaluate::Evaluator;
use super::event::{Event, Observer, StepsTaken, Warning};
use super::folder::RunFolder;
use super::log::{self, LogRow};
use super::log_writer::LogWriter;
use super::memory::MemoryUse;
use super::options::{EvaluationOptions, SavingOptions};
use super::resolve::Resolved;
use super::stepper::{Block, Stepper};
use crate::capture::dataset::Dataset;
use crate::capture::health::parallax::ParallaxSurvey;
use crate::config::schedule::Budget;
use crate::field::Field;
use crate::field::checkpoint::Metadata;
use crate::field::trainer::Trainer;
use crate::gpu::Gpu;
use crate::support::interrupt::{Interrupt, Interrupted};
use crate::support::metrics::PSNR_CAP_DB;
use crate::support::temporary::remove_leftovers;
use anyhow::{Context, Result};
pub use ending::NoTestViews;
use std::sync::Arc;
use std::thread;
use std::time::Instant;

/// Test views that are measured while training.
const FEW_VIEWS: usize = 4;

/// A training run that is about to begin or to go on.
#[derive(Debug)]
pub struct TrainingRun<'a> {
    /// What it runs on.
    pub gpu: Arc<Gpu>,
    /// Where its photos are.
    pub dataset: &'a Dataset,
    /// What is trained, and for how long.
    pub resolved: Resolved,
    /// Where its files go.
    pub folder: RunFolder,
    /// When test views are measured.
    pub evaluation: EvaluationOptions,
    /// Whether it begins although the host's memory seems not to suffice.
    pub overcommit: bool,
    /// When it is saved.
    pub saving: SavingOptions,
}

/// A training run under way.
#[derive(Debug)]
pub struct TrainingSession<'a> {
    metadata: Metadata,
    test: Vec<usize>,
    folder: RunFolder,
    evaluation: EvaluationOptions,
    saving: SavingOptions,
    stepper: Stepper,
    log: LogWriter,
    /// `None` where nothing is measured.
    evaluator: Option<Evaluator<'a>>,
    /// Step and seconds at the beginning of this session.
    start: (u32, f64),
    /// Step and seconds of the newest checkpoint; step 0 when there is none.
    saved: (u32, f64),
    /// Seconds of training when saving was tried last.
    tried: f64,
    /// Whether rows of the log could not be written.
    is_log_lacking: bool,
    /// The first and the last loss of this session.
    loss: Option<[f64; 2]>,
    is_empty: bool,
    memory: MemoryUse,
}

/// How a session ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainingEnd {
    /// Steps taken, those of earlier sessions included.
    pub step: u32,
    /// Seconds of training, those of earlier sessions included.
    pub seconds: f64,
    /// The first and the last loss of this session; `None` when no step was taken.
    pub loss: Option<[f64; 2]>,
    /// Steps of this session whose gradients could not be used.
    pub skipped: u32,
    /// Whether it was asked to stop before its end.
    pub interrupted: bool,
}

impl<'a> TrainingRun<'a> {
    /// Loads the photos, builds the kernels, and begins or goes on with the files of the folder.
    ///
    /// # Errors
    /// When the memory does not suffice, a photo cannot be read, the adapter refuses a kernel, its interrupt was raised, or
    /// the folder cannot be written to.
    pub fn begin(self, observer: &mut dyn Observer) -> Result<TrainingSession<'a>> {
        let Self { gpu, dataset, mut resolved, mut folder, evaluation, saving, overcommit } = self;
        let Resolved { metadata, plan, test, .. } = &resolved;
        observer.notice(&Event::Resolved { metadata, plan, gpu: &gpu, test_views: test.len() });
        if let Some(usual) = resolved.usual_kept {
            let kept = metadata.config.batch.kept;
            observer.notice(&Event::Warning(Warning::SmallerBatch { adapter: &gpu.info.name, kept, usual }));
        }
        let tested = if evaluation.few(FEW_VIEWS).is_some() { &resolved.test[..] } else { &[] };
        let memory = resolved.check_memory(&gpu, dataset, tested, overcommit, observer)?;
        if folder.is_unguarded() {
            observer.notice(&Event::Warning(Warning::Unguarded { folder: folder.path() }));
        }
        let home = folder.of_checkpoint()?;
        remove_leftovers(&home);
        // Those that stay, and one that is being written.
        disk::check(&home, plan.state_bytes(), saving.keep as u64 + 1, observer)?;
        let clock = Instant::now();
        let parallax = ParallaxSurvey::of(dataset, &resolved.train, &resolved.metadata.bounds);
        let look = |frame, photo: &_| parallax.look(frame, photo);
        let views = resolved.photos(dataset).load_beside(&gpu, &resolved.plan, &look, observer)?;
        // Beside the kernels, of which building takes about as long.
        let parallax = thread::spawn(move || parallax.finding());
        let load_seconds = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let mut trainer = Trainer::new(Field::new(&gpu, resolved.plan.clone())?, views)?;
        // While its kernels are compiled, which the first steps wait for.
        let evaluator = match evaluation.few(FEW_VIEWS) {
            Some(few) => resolved.evaluator(&trainer, dataset, few)?,
            None => None,
        };
        trainer.warm_up()?;
        // It is as large as the field, and not needed any more.
        let state = resolved.state.take();
        state.as_ref().map_or(Ok(()), |state| trainer.restore(state))?;
        let compile_seconds = clock.elapsed().as_secs_f64();
        if let Ok(Some(finding)) = parallax.join() {
            observer.notice(&Event::Warning(Warning::BeyondBox { finding: &finding }));
        }
        let Resolved { metadata, plan, test, .. } = resolved;
        folder.make_again(&metadata.config)?;
        let mut log = folder.begin(&metadata.config, state.map(|state| state.step))?;
        log.add(&LogRow::Start(log::Start {
            step: metadata.step.into(),
            adapter: Some(metadata.adapter.clone()),
            driver: Some(format!("{} {}", gpu.info.driver, gpu.info.driver_info)),
            left_out: plan.left_out(),
            load_seconds: Some(load_seconds),
            compile_seconds: Some(compile_seconds),
        }))?;
        log.flush()?;
        let stepper = Stepper::new(trainer, StepClock::new(&metadata, log.logged_seconds()));
        let start = (stepper.steps(), stepper.seconds());
        Ok(TrainingSession {
            metadata,
            test,
            folder,
            evaluation,
            saving,
            stepper,
            log,
            evaluator,
            start,
            saved: start,
            tried: start.1,
            is_log_lacking: false,
            loss: None,
            is_empty: false,
            memory,
        })
    }
}

impl TrainingSession<'_> {
    /// What its checkpoints say, at the first step of this session.
    #[must_use]
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// What it was estimated to take of memory.
    #[must_use]
    pub fn memory(&self) -> &MemoryUse {
        &self.memory
    }

    /// The wish to stop.
    fn interrupt(&self) -> &Interrupt {
        &self.stepper.trainer().gpu().interrupt
    }

    /// Trains until the budget is spent or the device's interrupt is raised, and saves.
    ///
    /// # Errors
    /// When training diverges, the device was lost, or the checkpoint cannot be written in the end; until then that is a
    /// [`Warning`]. The newest checkpoint stays; the message names its step.
    pub fn train(&mut self, observer: &mut dyn Observer) -> Result<TrainingEnd> {
        while !self.stepper.is_over() && !self.interrupt().is_raised() {
            let step = self.stepper.steps();
            let every = self.evaluation.every;
            let pause = Budget {
                steps: every.map(|every| (step - step % every).saturating_add(every)),
                seconds: None,
            };
            let block = self.stepper.block(pause);
            let block =
                block.with_context(|| format!("at step {} ({})", self.stepper.steps(), self.kept()))?;
            self.record(block, observer)?;
            let evaluated = self.evaluate_if_due(observer);
            self.saved_despite(evaluated, observer)?;
            self.save_if_due(observer)?;
        }
        self.save_at_end(observer)?;
        let (step, seconds) = (self.stepper.steps(), self.stepper.seconds());
        let stages = self.stepper.stages().per_step();
        if !stages.is_empty() {
            let steps = self.stepper.stages().steps().into();
            self.log(&LogRow::Stages(log::Stages { step: step.into(), steps, stages }), observer)?;
            self.save_if_removed(observer)?;
        }
        observer.notice(&Event::Ended);
        let (skipped, interrupted) = (self.stepper.skipped(), !self.stepper.is_over());
        Ok(TrainingEnd { step, seconds, loss: self.loss, skipped, interrupted })
    }

    /// Logs a block and reports it.
    fn record(&mut self, block: Block, observer: &mut dyn Observer) -> Result<()> {
        let (step, seconds, stats) = (self.stepper.steps(), self.stepper.seconds(), block.stats);
        let clock = self.stepper.clock();
        let is_relative = self.stepper.trainer().plan().has_relative_loss();
        let psnr = (!is_relative).then(|| (-10.0 * stats.color_error.log10()).min(PSNR_CAP_DB));
        self.loss = Some([self.loss.map_or(stats.loss, |[first, _]| first), stats.loss]);
        if stats.samples == 0 && !self.is_empty {
            observer.notice(&Event::Warning(Warning::Empty { step }));
        }
        self.is_empty = stats.samples == 0;
        if stats.skipped > 0 && self.stepper.skipped() == stats.skipped {
            observer.notice(&Event::Warning(Warning::Skipped { step, skipped: stats.skipped }));
        }
        let row = log::Steps {
            step: step.into(),
            seconds: Some(seconds),
            loss: Some(stats.loss),
            psnr,
            rays: Some(stats.rays as f64),
            samples: Some(stats.samples as f64),
            marched: Some(stats.marched as f64),
            skipped: stats.skipped.into(),
            learning_rate: Some(clock.learning_rate(step, 0.0)),
        };
        let (spent, remaining) = (clock.spent(step), clock.remaining(step, self.start));
        self.log(&LogRow::Block(row), observer)?;
        observer.notice(&Event::Steps(StepsTaken { step, seconds, block, psnr, spent, remaining }));
        Ok(())
    }

    fn evaluate_if_due(&mut self, observer: &mut dyn Observer) -> Result<()> {
        let step = self.stepper.steps();
        let Some(evaluator) = &mut self.evaluator else { return Ok(()) };
        if self.evaluation.every.is_none_or(|every| !step.is_multiple_of(every)) {
            return Ok(());
        }
        let clock = Instant::now();
        let means = match evaluator.kept() {
            Err(error) if Interrupted::is_cause_of(&error) => None,
            measured => measured?,
        };
        let Some(means) = means else { return Ok(()) };
        observer.notice(&Event::Evaluated { step, means });
        let row = log::Evaluation {
            step: step.into(),
            seconds: Some(self.stepper.seconds()),
            eval_psnr: Some(means.psnr),
            eval_seconds: Some(clock.elapsed().as_secs_f64()),
            views: means.views as u64,
            near_share: means.near_share,
            ..log::Evaluation::default()
        };
        self.log(&LogRow::Evaluation(row), observer)
    }
}
