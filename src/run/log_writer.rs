//! The log of a run while it is written.

use super::log::LogRow;
use crate::support::file::write_atomically;
use crate::support::temporary::is_same;
use anyhow::{Context, Result};
use serde_json::Value;
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

/// An open log: one JSON object per line. Rows that could not be written are kept, and so are those of a file that was removed.
#[derive(Debug)]
pub struct LogWriter {
    path: PathBuf,
    file: File,
    /// All rows.
    text: String,
    /// How many bytes of them are in the file.
    written: usize,
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
        Ok(Self { path: path.to_owned(), file, text: String::new(), written: 0, seconds: 0.0 })
    }

    /// Goes on with a log behind what was logged up to `step`: rows of steps that are taken again, and a row
    /// that was not finished, are dropped.
    ///
    /// # Errors
    /// When the file cannot be read or written.
    pub fn resume(path: &Path, step: u32) -> Result<Self> {
        let earlier = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == ErrorKind::NotFound => String::new(),
            Err(error) => return Err(error).with_context(|| format!("reading {}", path.display())),
        };
        // As they are: a newer program may have written keys that this one does not know.
        let rows = earlier.lines().filter_map(|line| Some((line, serde_json::from_str(line).ok()?)));
        let is_kept = |(_, row): &(_, Value)| row["step"].as_u64().is_none_or(|at| at <= u64::from(step));
        let rows: Vec<_> = rows.filter(is_kept).collect();
        let text: String = rows.iter().flat_map(|(line, _)| [*line, "\n"]).collect();
        write_atomically(path, |file| Ok(file.write_all(text.as_bytes())?))?;
        let seconds = rows.iter().filter_map(|(_, row)| row["seconds"].as_f64()).fold(0.0, f64::max);
        let file = OpenOptions::new().append(true).open(path);
        let file = file.with_context(|| format!("opening {}", path.display()))?;
        Ok(Self { path: path.to_owned(), file, written: text.len(), text, seconds })
    }

    /// Seconds of training in the rows of earlier sessions.
    #[must_use]
    pub fn logged_seconds(&self) -> f64 {
        self.seconds
    }

    /// Adds a row, which [`LogWriter::flush`] writes.
    ///
    /// # Errors
    /// When it is no JSON.
    pub fn add(&mut self, row: &LogRow) -> Result<()> {
        self.text += &(serde_json::to_string(row)? + "\n");
        Ok(())
    }

    /// Writes the rows that are not in the file yet; all of them if it was removed.
    ///
    /// # Errors
    /// When the file cannot be written. What could be is not written again.
    pub fn flush(&mut self) -> Result<()> {
        self.write_rest().with_context(|| format!("writing {}", self.path.display()))
    }

    fn write_rest(&mut self) -> std::io::Result<()> {
        if !is_same(&self.file, &self.path) {
            self.file = File::create(&self.path)?;
            self.written = 0;
        }
        while self.written < self.text.len() {
            match self.file.write(&self.text.as_bytes()[self.written..]) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(count) => self.written += count,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
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
        log.add(&LogRow::Start(Start::default())).expect("JSON");
        for step in [16, 32, 48] {
            log.add(&steps(step)).expect("JSON");
        }
        log.flush().expect("writable");
        std::fs::write(&path, std::fs::read_to_string(&path).expect("text") + "{\"step\": 6")
            .expect("writable");
        let mut log = LogWriter::resume(&path, 32).expect("readable");
        assert_eq!(log.logged_seconds(), 4.0);
        log.add(&steps(64)).expect("JSON");
        log.flush().expect("writable");
        let text = std::fs::read_to_string(&path).expect("text");
        let begins: Vec<_> = text.lines().map(|line| line.split(",\"seconds").next()).collect();
        assert!(begins[0].is_some_and(|line| line.starts_with("{\"event\":\"start\",\"step\":0")), "{text}");
        let rows = [16, 32, 64].map(|step| format!("{{\"step\":{step}"));
        assert_eq!(begins[1..], rows.each_ref().map(|row| Some(row.as_str())), "{text}");
    }

    #[test]
    fn rows_are_written_when_there_is_a_place_for_them_again() {
        let place = tempfile::tempdir().expect("temporary folder");
        let folder = place.path().join("run");
        std::fs::create_dir(&folder).expect("writable");
        let path = folder.join("log.jsonl");
        let mut log = LogWriter::create(&path).expect("writable");
        let mut write = |step| log.add(&steps(step)).and_then(|()| log.flush());
        write(16).expect("writable");
        std::fs::remove_dir_all(&folder).expect("removable");
        let error = format!("{:#}", write(32).expect_err("there is no folder"));
        assert!(error.starts_with("writing") && error.contains("log.jsonl"), "{error}");
        std::fs::create_dir(&folder).expect("writable");
        write(48).expect("writable");
        let text = std::fs::read_to_string(&path).expect("text");
        let begins: Vec<_> = text.lines().filter_map(|line| line.split(',').next()).collect();
        assert_eq!(begins, [16, 32, 48].map(|step| format!("{{\"step\":{step}")));
    }
}
