//! What a reader of the dataset should know about how it was read.

use std::collections::HashMap;
use std::fmt;

use crate::support::remedy::{Advised, Remedy};

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
    /// The user's choice that the remark tells of in plain words, if there is one.
    pub remedy: Option<Remedy>,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

/// Collects notes; the same remark about many frames becomes one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Notes {
    entries: Vec<Entry>,
    /// Where a remark is, by its wording without the numbers in it.
    index: HashMap<String, usize>,
}

#[derive(Clone, Debug)]
struct Entry {
    severity: Severity,
    message: String,
    remedy: Option<Remedy>,
    first_frame: Option<String>,
    count: usize,
}

impl Notes {
    pub(crate) fn note(&mut self, message: impl Into<String>) {
        self.add(Severity::Note, message.into(), None);
    }

    pub(crate) fn warn(&mut self, message: impl Into<String>) {
        self.add(Severity::Warning, message.into(), None);
    }

    /// A remark with something to do about it.
    pub(crate) fn advise(&mut self, severity: Severity, advised: Advised) {
        let message = advised.to_string();
        self.merge(Entry { severity, message, remedy: Some(advised.remedy), first_frame: None, count: 1 });
    }

    /// A remark about one frame. Remarks that differ in numbers only become one, with the first numbers.
    pub(crate) fn frame(&mut self, severity: Severity, frame: &str, message: impl Into<String>) {
        self.add(severity, message.into(), Some(frame));
    }

    fn add(&mut self, severity: Severity, message: String, frame: Option<&str>) {
        let first_frame = frame.map(Into::into);
        self.merge(Entry { severity, message, remedy: None, first_frame, count: 1 });
    }

    fn merge(&mut self, entry: Entry) {
        let is_wording = |c: &char| !c.is_ascii_digit() && !matches!(c, '.' | '-');
        let wording: String = match entry.first_frame {
            Some(_) => entry.message.chars().filter(is_wording).collect(),
            None => entry.message.clone(),
        };
        match self.index.get(&wording) {
            Some(&at) => self.entries[at].count += entry.count,
            None => {
                self.index.insert(wording, self.entries.len());
                self.entries.push(entry);
            }
        }
    }

    pub(crate) fn append(&mut self, other: Self) {
        for entry in other.entries {
            self.merge(entry);
        }
    }

    pub(crate) fn finish(self) -> Vec<Note> {
        let finish = |entry: Entry| Note {
            severity: entry.severity,
            remedy: entry.remedy,
            message: match (entry.first_frame, entry.count) {
                (None, _) => entry.message,
                (Some(frame), 1) => format!("{frame}: {}", entry.message),
                (Some(frame), count) => {
                    format!("{frame} and {} more: {}", count - 1, entry.message)
                }
            },
        };
        self.entries.into_iter().map(finish).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_remark_about_many_frames_is_one() {
        let mut notes = Notes::default();
        notes.frame(Severity::Note, "frame 3", "the focal length is 1.5");
        notes.frame(Severity::Note, "frame 4", "the focal length is 22");
        notes.frame(Severity::Note, "frame 4", "the lens is odd");
        notes.note("2 frames");
        notes.note("3 frames");
        let messages: Vec<_> = notes.finish().into_iter().map(|note| note.message).collect();
        let expected = [
            "frame 3 and 1 more: the focal length is 1.5",
            "frame 4: the lens is odd",
            "2 frames",
            "3 frames",
        ];
        assert_eq!(messages, expected);
    }
}
