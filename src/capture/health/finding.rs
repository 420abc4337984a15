//! Findings, and the numbers they are told in.

use crate::capture::dataset;
use crate::support::remedy::{Advised, Remedy};
use serde::Serialize;

/// How much a [`Finding`] matters; the worst comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// A training would fail.
    Error,
    /// Something that probably makes results worse.
    Warning,
    /// Something to know.
    Note,
}

/// Something that looks wrong: what it is, how it was seen, what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// How much it matters.
    pub severity: Severity,
    /// One or two full sentences.
    pub message: String,
    /// The user's choice that the message tells of in plain words, if there is one.
    pub remedy: Option<Remedy>,
    /// Indices of the frames it is about; empty where it is about all.
    pub frames: Vec<usize>,
}

impl Finding {
    /// A training would fail.
    pub fn error(message: impl Into<String>) -> Self {
        Self { severity: Severity::Error, message: message.into(), remedy: None, frames: Vec::new() }
    }

    /// Something that probably makes results worse.
    pub fn warning(message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, ..Self::error(message) }
    }

    /// Something to know.
    pub fn note(message: impl Into<String>) -> Self {
        Self { severity: Severity::Note, ..Self::error(message) }
    }

    /// The same, about some frames.
    #[must_use]
    pub fn about(self, frames: Vec<usize>) -> Self {
        Self { frames, ..self }
    }
}

impl From<&dataset::Note> for Finding {
    fn from(note: &dataset::Note) -> Self {
        let finding = match note.severity {
            dataset::Severity::Warning => Self::warning(&note.message),
            dataset::Severity::Note => Self::note(&note.message),
        };
        Self { remedy: note.remedy.clone(), ..finding }
    }
}

impl From<Advised> for Finding {
    /// A training would fail.
    fn from(advised: Advised) -> Self {
        Self { remedy: Some(advised.remedy.clone()), ..Self::error(advised.to_string()) }
    }
}

/// The least, the middle and the largest of some numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// The least.
    pub min: f64,
    /// The middle one, the upper of two.
    pub median: f64,
    /// The largest.
    pub max: f64,
}

impl Spread {
    /// That of `values`; all 0 without any.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut values: Vec<f64> = values.into_iter().collect();
        values.sort_by(f64::total_cmp);
        let Some((&min, &max)) = values.first().zip(values.last()) else { return Self::default() };
        Self { min, median: values[values.len() / 2], max }
    }

    /// In words: one number where all are the same as far as `say` tells.
    #[must_use]
    pub fn tell(&self, say: impl Fn(f64) -> String) -> String {
        let [min, median, max] = [self.min, self.median, self.max].map(say);
        if min == max { median } else { format!("{min} to {max}, median {median}") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads_are_short_where_they_can_be() {
        let say = |value: f64| format!("{value:.1} m");
        assert_eq!(Spread::of([3.0, 1.0, 2.0]).tell(say), "1.0 m to 3.0 m, median 2.0 m");
        assert_eq!(Spread::of([1.0, 1.01]).tell(say), "1.0 m");
        assert_eq!(Spread::of([]), Spread::default());
        assert!(Severity::Error < Severity::Warning && Severity::Warning < Severity::Note);
    }
}
