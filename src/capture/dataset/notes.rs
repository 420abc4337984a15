//! What a reader of the dataset should know about how it was read.

use std::collections::HashMap;

use crate::capture::diagnostics::{Diagnostic, Severity};
use crate::support::remedy::{Advised, Remedy};

/// Collects notes; the same remark about many frames becomes one.
#[derive(Clone, Debug, Default)]
pub(crate) struct Notes {
    entries: Vec<Pending>,
    /// Where a remark is, by its wording without the numbers in it.
    index: HashMap<String, usize>,
}

/// Words a message that tells a number.
type Tell = fn(f64) -> String;

#[derive(Clone, Debug)]
struct Pending {
    severity: Severity,
    message: String,
    remedy: Option<Remedy>,
    first_frame: Option<String>,
    count: usize,
    /// The largest of the numbers that the message tells, and how.
    worst: Option<(f64, Tell)>,
}

impl Pending {
    fn new(severity: Severity, message: String) -> Self {
        Self { severity, message, remedy: None, first_frame: None, count: 1, worst: None }
    }
}

impl Notes {
    pub(crate) fn note(&mut self, message: impl Into<String>) {
        self.merge(Pending::new(Severity::Note, message.into()));
    }

    pub(crate) fn warn(&mut self, message: impl Into<String>) {
        self.merge(Pending::new(Severity::Warning, message.into()));
    }

    /// What keeps training from beginning.
    pub(crate) fn error(&mut self, message: impl Into<String>) {
        self.merge(Pending::new(Severity::Error, message.into()));
    }

    /// A remark of any severity.
    pub(crate) fn say(&mut self, severity: Severity, message: impl Into<String>) {
        self.merge(Pending::new(severity, message.into()));
    }

    /// A remark with something to do about it.
    pub(crate) fn advise(&mut self, severity: Severity, advised: Advised) {
        let message = advised.to_string();
        self.merge(Pending { remedy: Some(advised.remedy), ..Pending::new(severity, message) });
    }

    /// A remark about one frame. Remarks that differ in numbers only become one, with the first numbers.
    pub(crate) fn frame(&mut self, severity: Severity, frame: &str, message: impl Into<String>) {
        self.merge(Pending { first_frame: Some(frame.to_owned()), ..Pending::new(severity, message.into()) });
    }

    /// A remark about one frame that tells a number: of many frames, the largest.
    pub(crate) fn worst(&mut self, severity: Severity, frame: &str, number: f64, tell: Tell) {
        let first_frame = Some(frame.to_owned());
        let pending = Pending::new(severity, tell(number));
        self.merge(Pending { first_frame, worst: Some((number, tell)), ..pending });
    }

    fn merge(&mut self, entry: Pending) {
        let is_wording = |c: &char| !c.is_ascii_digit() && !matches!(c, '.' | '-' | 'e');
        let wording: String = match entry.first_frame {
            Some(_) => entry.message.chars().filter(is_wording).collect(),
            None => entry.message.clone(),
        };
        match self.index.get(&wording) {
            Some(&at) => {
                let known = &mut self.entries[at];
                known.count += entry.count;
                if let (Some((most, _)), Some((number, tell))) = (&mut known.worst, entry.worst)
                    && number > *most
                {
                    *most = number;
                    known.message = tell(number);
                }
            }
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

    pub(crate) fn finish(self) -> Vec<Diagnostic> {
        let finish = |entry: Pending| Diagnostic {
            frames: Vec::new(),
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
        for off in [1.0, 3e-4, 2.5, 2.0] {
            notes.worst(Severity::Warning, "frame 5", off, |off| format!("off by up to {off:.1e}"));
        }
        let messages: Vec<_> = notes.finish().into_iter().map(|note| note.message).collect();
        let expected = [
            "frame 3 and 1 more: the focal length is 1.5",
            "frame 4: the lens is odd",
            "2 frames",
            "3 frames",
            "frame 5 and 3 more: off by up to 2.5e0",
        ];
        assert_eq!(messages, expected);
    }
}
