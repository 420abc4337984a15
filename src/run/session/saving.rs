//! What a session writes while it trains: checkpoints and the log. A file that cannot be written does not end the training.

use super::TrainingSession;
use crate::field::checkpoint::{self, Checkpoint, Metadata};
use crate::run::event::{Event, Observer, Warning};
use crate::run::log::LogRow;
use crate::support::lock::InUse;
use anyhow::{Context, Error, Result};
use std::io;
use std::time::Duration;

/// Pauses between attempts to save at the end, when the next interval does not come.
const PAUSES: [Duration; 3] = [Duration::from_secs(1), Duration::from_secs(2), Duration::from_secs(4)];

impl TrainingSession<'_> {
    /// Adds a row to the log; rows that cannot be written are kept and tried again with the next one.
    pub(super) fn log(&mut self, row: &LogRow, observer: &mut dyn Observer) -> Result<()> {
        self.log.add(row)?;
        let outcome = self.make_folder_again(observer).and_then(|()| self.log.flush());
        self.is_log_lacking = match outcome {
            Err(error) if is_of_files(&error) => {
                if !self.is_log_lacking {
                    let reason = &format!("{error:#}");
                    observer.notice(&Event::Warning(Warning::NotLogged { reason }));
                }
                true
            }
            outcome => outcome.map(|()| false)?,
        };
        Ok(())
    }

    /// Fails where rows of the log could not be written until the end.
    ///
    /// # Errors
    /// As said.
    pub fn finish_log(&mut self) -> Result<()> {
        self.log.flush()
    }

    /// Saves when it is time to.
    pub(super) fn save_if_due(&mut self, observer: &mut dyn Observer) -> Result<()> {
        if self.stepper.seconds() - self.tried < self.saving.every {
            return Ok(());
        }
        self.try_to_save(false, observer)?;
        Ok(())
    }

    /// Saves again where the folder was removed.
    pub(super) fn save_if_removed(&mut self, observer: &mut dyn Observer) -> Result<()> {
        if self.saved.0 < self.stepper.steps() { self.save(observer) } else { Ok(()) }
    }

    /// Saves when all steps are taken, unless it is; tries again a few times unless an end was asked for, since all since the
    /// last checkpoint would be lost.
    pub(super) fn save_at_end(&mut self, observer: &mut dyn Observer) -> Result<()> {
        let newest = Checkpoint::check(&self.folder.checkpoint());
        if newest.is_ok_and(|newest| newest.step == self.stepper.steps()) {
            return Ok(());
        }
        for (earlier, pause) in PAUSES.into_iter().enumerate() {
            if self.interrupt().is_raised() {
                break;
            }
            if self.try_to_save(earlier > 0, observer)? {
                return Ok(());
            }
            self.interrupt().sleep(pause);
        }
        self.save(observer)
    }

    fn save(&mut self, observer: &mut dyn Observer) -> Result<()> {
        let step = self.stepper.steps();
        self.tried = self.stepper.seconds();
        let attempt = |session: &mut Self, observer: &mut dyn Observer| {
            session.make_folder_again(observer)?;
            let seconds = session.stepper.clock().recorded_seconds();
            let metadata = Metadata { seconds, ..session.metadata.clone() };
            let path = session.folder.checkpoint();
            checkpoint::replace(&path, step, session.saving.keep, || {
                session.stepper.trainer().save(&path, metadata)
            })
        };
        let saved = attempt(self, observer);
        saved.with_context(|| format!("at step {step} ({})", self.kept()))?;
        self.saved = (step, self.stepper.seconds());
        observer.notice(&Event::Saved { step, path: &self.folder.checkpoint() });
        Ok(())
    }

    /// Saves where something besides the training failed; the failure says which checkpoint is kept.
    pub(super) fn saved_despite(&mut self, outcome: Result<()>, observer: &mut dyn Observer) -> Result<()> {
        let Err(failure) = outcome else { return Ok(()) };
        // Where the device is lost that fails too, and the checkpoint before is kept.
        let _ = self.save_if_removed(observer);
        Err(failure.context(format!("at step {} ({})", self.stepper.steps(), self.kept())))
    }

    /// Makes the folder again where it was removed, which is said; a checkpoint is due then.
    fn make_folder_again(&mut self, observer: &mut dyn Observer) -> Result<()> {
        if self.folder.make_again(&self.metadata.config)? {
            self.saved = (0, 0.0);
            self.tried = f64::NEG_INFINITY;
            observer.notice(&Event::Warning(Warning::FolderRemoved { folder: self.folder.path() }));
        }
        Ok(())
    }

    /// Saves; whether that worked. That files could not be written is said, unless it was.
    fn try_to_save(&mut self, is_said: bool, observer: &mut dyn Observer) -> Result<bool> {
        match self.save(observer) {
            Err(error) if is_of_files(&error) && is_said => Ok(false),
            Err(error) if is_of_files(&error) => {
                let reason = &format!("{error:#}");
                observer.notice(&Event::Warning(Warning::NotSaved { reason }));
                Ok(false)
            }
            outcome => outcome.map(|()| true),
        }
    }

    /// The state to resume from.
    pub(super) fn kept(&self) -> String {
        match self.saved.0 {
            0 => "nothing was saved yet".to_owned(),
            step => format!("the checkpoint of step {step} is kept"),
        }
    }
}

/// Whether files could not be written, for whatever reason.
fn is_of_files(error: &Error) -> bool {
    error.chain().any(|cause| cause.is::<io::Error>() || cause.is::<InUse>())
}
