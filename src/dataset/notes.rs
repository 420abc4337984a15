//! What a reader of the dataset should know about how it was read.

use std::fmt;

/// How much a [`Note`] matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// An assumption or repair that is usually right.
    Note,
    /// Something that probably makes results worse.
    Warning,
}

/// One remark about a dataset, a full sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Note {
    /// How much it matters.
    pub severity: Severity,
    /// The remark.
    pub message: String,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

/// Collects notes; the same remark about many frames becomes one.
#[derive(Debug, Default)]
pub(super) struct Notes(Vec<Entry>);

#[derive(Debug)]
struct Entry {
    severity: Severity,
    message: String,
    first_frame: Option<String>,
    count: usize,
}

impl Notes {
    pub(super) fn note(&mut self, message: impl Into<String>) {
        self.add(Severity::Note, message.into(), None);
    }

    pub(super) fn warn(&mut self, message: impl Into<String>) {
        self.add(Severity::Warning, message.into(), None);
    }

    /// A remark about one frame; it should not contain numbers that differ from frame to frame.
    pub(super) fn frame(&mut self, severity: Severity, frame: &str, message: impl Into<String>) {
        self.add(severity, message.into(), Some(frame));
    }

    fn add(&mut self, severity: Severity, message: String, frame: Option<&str>) {
        match self.0.iter_mut().find(|entry| entry.message == message) {
            Some(entry) => entry.count += 1,
            None => self.0.push(Entry { severity, message, first_frame: frame.map(Into::into), count: 1 }),
        }
    }

    pub(super) fn append(&mut self, other: Self) {
        for entry in other.0 {
            match self.0.iter_mut().find(|own| own.message == entry.message) {
                Some(own) => own.count += entry.count,
                None => self.0.push(entry),
            }
        }
    }

    pub(super) fn finish(self) -> Vec<Note> {
        let finish = |entry: Entry| Note {
            severity: entry.severity,
            message: match (entry.first_frame, entry.count) {
                (None, _) => entry.message,
                (Some(frame), 1) => format!("{frame}: {}", entry.message),
                (Some(frame), count) => {
                    format!("{frame} and {} more: {}", count - 1, entry.message)
                }
            },
        };
        self.0.into_iter().map(finish).collect()
    }
}
