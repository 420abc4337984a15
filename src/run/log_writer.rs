//! The log of a run while it is written.

use super::log::LogRow;
use crate::support::file::write_atomically;
use anyhow::{Context, Result};
use serde_json::Value;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// An open log: one JSON object per line.
#[derive(Debug)]
pub struct LogWriter {
    path: PathBuf,
    file: File,
    /// Seconds of training of the rows before.
    seconds: f64,
}

impl LogWriter {
    /// Begins a new log.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn create(path: &Path) -> Result<Self> {
        let file = File::create(path).with_context(|| format!("creating {}", path.display()))?;
        Ok(Self { path: path.to_owned(), file, seconds: 0.0 })
    }

    /// Goes on with a log behind what was logged up to `step`: rows of steps that are taken again, and a row
    /// that was not finished, are dropped.
    ///
    /// # Errors
    /// When the file cannot be read or written.
    pub fn resume(path: &Path, step: u32) -> Result<Self> {
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(error).with_context(|| format!("reading {}", path.display())),
        };
        // As they are: a newer program may have written keys that this one does not know.
        let rows = text.lines().filter_map(|line| Some((line, serde_json::from_str(line).ok()?)));
        let is_kept = |(_, row): &(_, Value)| row["step"].as_u64().is_none_or(|at| at <= u64::from(step));
        let rows: Vec<_> = rows.filter(is_kept).collect();
        write_atomically(path, |file| rows.iter().try_for_each(|(line, _)| Ok(writeln!(file, "{line}")?)))?;
        let seconds = rows.iter().filter_map(|(_, row)| row["seconds"].as_f64()).fold(0.0, f64::max);
        let file = OpenOptions::new().append(true).open(path);
        let file = file.with_context(|| format!("opening {}", path.display()))?;
        Ok(Self { path: path.to_owned(), file, seconds })
    }

    /// Seconds of training in the rows of earlier sessions.
    #[must_use]
    pub fn logged_seconds(&self) -> f64 {
        self.seconds
    }

    /// Adds a row; it is in the file when this returns.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&mut self, row: &LogRow) -> Result<()> {
        let line = serde_json::to_string(row)? + "\n";
        self.file.write_all(line.as_bytes()).with_context(|| format!("writing {}", self.path.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::log::{Start, Steps};
    use super::*;

    fn steps(step: u64) -> LogRow {
        LogRow::Block(Steps { step, seconds: Some(step as f64 / 8.0), ..Steps::default() })
    }

    #[test]
    fn a_resumed_log_forgets_what_comes_again() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("log.jsonl");
        let mut log = LogWriter::create(&path).expect("writable");
        log.write(&LogRow::Start(Start::default())).expect("writable");
        for step in [16, 32, 48] {
            log.write(&steps(step)).expect("writable");
        }
        std::fs::write(&path, std::fs::read_to_string(&path).expect("text") + "{\"step\": 6")
            .expect("writable");
        let mut log = LogWriter::resume(&path, 32).expect("readable");
        assert_eq!(log.logged_seconds(), 4.0);
        log.write(&steps(64)).expect("writable");
        let text = std::fs::read_to_string(&path).expect("text");
        let begins: Vec<_> = text.lines().map(|line| line.split(",\"seconds").next()).collect();
        assert!(begins[0].is_some_and(|line| line.starts_with("{\"event\":\"start\",\"step\":0")), "{text}");
        let rows = [16, 32, 64].map(|step| format!("{{\"step\":{step}"));
        assert_eq!(begins[1..], rows.each_ref().map(|row| Some(row.as_str())), "{text}");
    }
}
