//! `log.jsonl`: one JSON object per line.

use anyhow::{Context, Result};
use nerf::support::file::write_atomically;
use serde_json::Value;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// An open log.
#[derive(Debug)]
pub(super) struct Log {
    path: PathBuf,
    file: File,
    /// Seconds of training that its rows tell of.
    pub(super) seconds: f64,
}

impl Log {
    /// Begins a new log.
    pub(super) fn create(path: &Path) -> Result<Self> {
        let file = File::create(path).with_context(|| format!("creating {}", path.display()))?;
        Ok(Self { path: path.to_owned(), file, seconds: 0.0 })
    }

    /// Goes on with a log behind what was logged up to `step`: rows of steps that are taken again, and a row
    /// that was not finished, are dropped.
    pub(super) fn resume(path: &Path, step: u32) -> Result<Self> {
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(error) => return Err(error).with_context(|| format!("reading {}", path.display())),
        };
        let rows = text.lines().filter_map(|line| Some((line, serde_json::from_str(line).ok()?)));
        let is_kept = |(_, row): &(_, Value)| row["step"].as_u64().is_none_or(|at| at <= u64::from(step));
        let rows: Vec<_> = rows.filter(is_kept).collect();
        write_atomically(path, |file| rows.iter().try_for_each(|(line, _)| Ok(writeln!(file, "{line}")?)))?;
        let seconds = rows.iter().filter_map(|(_, row)| row["seconds"].as_f64()).fold(0.0, f64::max);
        let file = OpenOptions::new().append(true).open(path);
        let file = file.with_context(|| format!("opening {}", path.display()))?;
        Ok(Self { path: path.to_owned(), file, seconds })
    }

    /// Adds a row; it is in the file when this returns.
    pub(super) fn write(&mut self, row: &Value) -> Result<()> {
        let line = format!("{row}\n");
        self.file.write_all(line.as_bytes()).with_context(|| format!("writing {}", self.path.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_resumed_log_forgets_what_comes_again() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("log.jsonl");
        let mut log = Log::create(&path).expect("writable");
        log.write(&json!({ "event": "start" })).expect("writable");
        for step in [16, 32, 48] {
            log.write(&json!({ "seconds": f64::from(step) / 8.0, "step": step })).expect("writable");
        }
        std::fs::write(&path, std::fs::read_to_string(&path).expect("text") + "{\"step\": 6")
            .expect("writable");
        let mut log = Log::resume(&path, 32).expect("readable");
        assert_eq!(log.seconds, 4.0);
        log.write(&json!({ "step": 64 })).expect("writable");
        let text = std::fs::read_to_string(&path).expect("text");
        let lines: Vec<_> = text.lines().collect();
        let [first, second, rest] = ["2.0,\"step\":16}", "4.0,\"step\":32}", "{\"step\":64}"];
        assert_eq!(lines[0], "{\"event\":\"start\"}");
        assert!(lines[1].ends_with(first) && lines[2].ends_with(second) && lines[3..] == [rest], "{text}");
    }
}
