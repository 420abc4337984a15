//! What is said about a dataset: how much it matters, what it is, and what to do.

use crate::support::format::count;
use crate::support::remedy::{Advised, Remedy};
use serde::Serialize;
use std::fmt;

/// How much a [`Diagnostic`] matters; the worst comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Training would fail.
    Error,
    /// Something that probably makes results worse.
    Warning,
    /// Something to know, or an assumption or repair that is usually right.
    Note,
}

/// Something to know about a dataset, or wrong with it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// How much it matters.
    pub severity: Severity,
    /// One or two full sentences.
    pub message: String,
    /// The user's choice that the message describes in plain words, if there is one.
    pub remedy: Option<Remedy>,
    /// Indices of the frames it is about; empty where it is about all, or the message names them.
    pub frames: Vec<usize>,
}

impl Diagnostic {
    /// Training would fail.
    pub fn error(message: impl Into<String>) -> Self {
        Self::new(Severity::Error, message)
    }

    /// Something that probably makes results worse.
    pub fn warning(message: impl Into<String>) -> Self {
        Self::new(Severity::Warning, message)
    }

    /// Something to know.
    pub fn note(message: impl Into<String>) -> Self {
        Self::new(Severity::Note, message)
    }

    /// About all frames, with nothing to choose.
    pub fn new(severity: Severity, message: impl Into<String>) -> Self {
        Self { severity, message: message.into(), remedy: None, frames: Vec::new() }
    }

    /// Something with a choice of the user's to make.
    pub fn advise(severity: Severity, advised: Advised) -> Self {
        Self { remedy: Some(advised.remedy.clone()), ..Self::new(severity, advised.to_string()) }
    }

    /// The same, about some frames.
    #[must_use]
    pub fn about(self, frames: Vec<usize>) -> Self {
        Self { frames, ..self }
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl From<Advised> for Diagnostic {
    /// Training would fail.
    fn from(advised: Advised) -> Self {
        Self::advise(Severity::Error, advised)
    }
}

/// What keeps training from beginning where masks ignore all of its photos; `inverts` if masks were inverted.
pub(crate) fn nothing_counts(photos: usize, inverts: bool) -> Advised {
    let photos = count(photos, "training photo");
    let found = format!("the masks ignore every pixel of all {photos}; they may be inverted: ");
    let remedy = if inverts { Remedy::LeaveMasks } else { Remedy::InvertMasks };
    Advised::new(found, remedy, "")
}

/// What keeps training with depth from beginning where no photo has any.
pub(crate) const NO_DEPTH_KNOWN: &str = "no pixel of the training photos has a known depth: all values are 0, negative, not \
                                         finite, the largest that their files can hold, or beyond the scene box by far; \
                                         check their units";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_comes_first() {
        assert!(Severity::Error < Severity::Warning && Severity::Warning < Severity::Note);
    }
}
