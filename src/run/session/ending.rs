//! The end of a session: the test views are measured, and the page about the run is written.

use super::{TrainingEnd, TrainingSession};
use crate::field::checkpoint::Metadata;
use crate::run::event::Observer;
use crate::run::log::{self, LogRow};
use crate::run::options::EvaluationAtEnd;
use crate::run::report::test_views::TestViews;
use crate::run::report::{Facts, Report};
use anyhow::Result;
use std::path::PathBuf;
use std::time::{Instant, SystemTime};

/// Measuring the test views at the end takes at most this part of the training time, unless all are asked for.
const EVALUATION_SHARE: f64 = 0.1;

/// Why test views were not measured at the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoTestViews {
    /// There are none.
    NoneHeldOut,
    /// The session was asked to stop before its end.
    Interrupted,
    /// They were not asked for.
    NotAsked,
}

impl TrainingSession<'_> {
    /// Measures the test views as the field is at the end, and logs what they say; or why they are not measured. Where the
    /// device's interrupt is raised meanwhile, those measured by then are all.
    ///
    /// # Errors
    /// When a photo cannot be read, the device was lost, or the log cannot be written.
    pub fn evaluate(
        &mut self,
        end: &TrainingEnd,
        observer: &mut dyn Observer,
    ) -> Result<Result<TestViews, NoTestViews>> {
        let evaluator = match &mut self.evaluator {
            _ if self.test.is_empty() => return Ok(Err(NoTestViews::NoneHeldOut)),
            _ if end.interrupted => return Ok(Err(NoTestViews::Interrupted)),
            Some(evaluator) if self.evaluation.at_end != EvaluationAtEnd::Nothing => evaluator,
            _ => return Ok(Err(NoTestViews::NotAsked)),
        };
        let clock = Instant::now();
        // What is to be the same again must not depend on the clock.
        let is_limited =
            self.evaluation.at_end == EvaluationAtEnd::Share && !self.metadata.config.deterministic;
        let limit = is_limited.then_some(EVALUATION_SHARE * end.seconds);
        let views = TestViews::measure(evaluator, &self.test, limit, observer)?;
        if views.count() == 0 && self.interrupt().is_raised() {
            return Ok(Err(NoTestViews::Interrupted));
        }
        if let Some(summary) = views.summary() {
            let row = log::Evaluation {
                step: end.step.into(),
                seconds: Some(end.seconds),
                eval_psnr: Some(summary.psnr),
                eval_ssim: Some(summary.ssim),
                eval_seconds: Some(clock.elapsed().as_secs_f64()),
                views: summary.views,
                views_left_out: Some(summary.left_out),
                near_share: summary.near_share,
            };
            self.log(&LogRow::Evaluation(row), observer)?;
            self.save_if_removed(observer)?;
        }
        Ok(Ok(views))
    }

    /// Writes the page about the run, with the test views or why there are none; where it is.
    ///
    /// # Errors
    /// When the log cannot be read, a chart cannot be drawn, or the page cannot be written.
    pub fn write_report(&self, end: &TrainingEnd, views: Result<TestViews, String>) -> Result<PathBuf> {
        let metadata = Metadata { step: end.step, seconds: end.seconds, ..self.metadata.clone() };
        let facts = Facts { trained: Some(SystemTime::now()), ..Facts::of(self.folder.path(), &metadata)? };
        let out = self.folder.report();
        Report { facts, log: self.folder.log()?, views }.save(&out)?;
        Ok(out)
    }
}
