//! Console on stderr.

use crate::cli::Global;
use crate::flags::message_with_flags;
use nerf::capture::dataset::Dataset;
use nerf::capture::diagnostics::Severity;
use nerf::run::depths::fog;
use std::io::Write;

/// Prints messages, as far as the command line asks for them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Console {
    /// Nothing at all.
    pub(crate) quiet: bool,
    verbose: bool,
}

impl Console {
    /// What the command line asks for.
    pub(crate) fn new(global: &Global) -> Self {
        Self { quiet: global.quiet, verbose: global.verbose > 0 }
    }

    /// A line that everybody should see.
    pub(crate) fn say(self, line: &str) {
        if !self.quiet {
            // Nobody may be listening.
            let _ = writeln!(std::io::stderr(), "{line}");
        }
    }

    /// Something that probably makes results worse.
    pub(crate) fn warn(self, line: &str) {
        self.say(&format!("warning: {line}"));
    }

    /// Warns where a near share looks like fog.
    pub(crate) fn fog(self, near_share: Option<f64>) {
        if let Some(fog) = near_share.and_then(fog) {
            self.warn(&fog);
        }
    }

    /// A line for `--verbose`.
    pub(crate) fn detail(self, line: &str) {
        if self.verbose {
            self.say(line);
        }
    }

    /// What was assumed or looks wrong in a dataset.
    pub(crate) fn notes(self, dataset: &Dataset) {
        for note in &dataset.notes {
            match note.severity {
                Severity::Note => {
                    self.say(&format!("note: {}", message_with_flags(&note.message, note.remedy.as_ref())));
                }
                Severity::Warning | Severity::Error => {
                    self.warn(&message_with_flags(&note.message, note.remedy.as_ref()));
                }
            }
        }
    }
}
