//! A generated dataset to damage, and what `nerf info` says of it.

use crate::program::nerf;
use crate::support::folder;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A generated dataset to damage.
pub(crate) struct Toys {
    pub(crate) folder: TempDir,
}

impl Toys {
    pub(crate) fn new() -> Self {
        let folder = folder();
        let out = folder.path().join("toys");
        let scene =
            ["generate", "toys", "--views", "24", "--size", "64", "--samples", "1", "--quiet", "--out"];
        nerf().args(scene).arg(&out).assert().success();
        Self { folder }
    }

    pub(crate) fn path(&self) -> PathBuf {
        self.folder.path().join("toys")
    }

    pub(crate) fn photo(&self, index: usize) -> PathBuf {
        self.path().join(format!("train/{index:04}.png"))
    }

    /// Changes one of the files.
    pub(crate) fn edit(&self, split: &str, change: impl FnOnce(&mut Value)) {
        let path = self.path().join(format!("transforms_{split}.json"));
        let mut file: Value =
            serde_json::from_str(&fs::read_to_string(&path).expect("readable")).expect("JSON");
        change(&mut file);
        fs::write(path, file.to_string()).expect("writable");
    }

    /// Changes every matrix.
    pub(crate) fn edit_matrices(&self, change: impl Fn(&mut Value)) {
        for split in ["train", "val", "test"] {
            self.edit(split, |file| {
                let frames = file["frames"].as_array_mut().expect("a list");
                frames.iter_mut().for_each(|frame| change(&mut frame["transform_matrix"]));
            });
        }
    }

    /// Changes a training photo.
    pub(crate) fn edit_photo(
        &self,
        index: usize,
        change: impl FnOnce(image::DynamicImage) -> image::DynamicImage,
    ) {
        let path = self.photo(index);
        change(image::open(&path).expect("readable")).save(&path).expect("writable");
    }

    pub(crate) fn info(&self) -> Result {
        info(&self.path(), &[])
    }
}

/// What `nerf info --json` said.
pub(crate) struct Result {
    pub(crate) json: Value,
    pub(crate) code: i32,
    pub(crate) stderr: String,
}

pub(crate) fn info(path: &Path, args: &[&str]) -> Result {
    let output = nerf().args(["info", "--json"]).args(args).arg(path).output().expect("runs");
    let stderr = String::from_utf8(output.stderr).expect("text");
    assert!(!stderr.contains("panicked"), "{stderr}");
    let json = serde_json::from_slice(&output.stdout).expect("one JSON object");
    Result { json, code: output.status.code().expect("no signal"), stderr }
}

impl Result {
    pub(crate) fn of_severity(&self, severity: &str) -> Vec<&str> {
        let problems = self.json["problems"].as_array().expect("a list").iter();
        let problems = problems.filter(|problem| problem["severity"] == severity);
        problems.map(|problem| problem["message"].as_str().expect("a text")).collect()
    }

    /// Expects the exit code and a problem of the severity with all of `parts`, about the frames.
    pub(crate) fn expect(&self, code: i32, severity: &str, parts: &[&str], frames: &[&str]) {
        assert_eq!(self.code, code, "{:#} {}", self.json["problems"], self.stderr);
        let problems = self.json["problems"].as_array().expect("a list").iter();
        let is_meant = |problem: &&Value| {
            let message = problem["message"].as_str().expect("a text");
            problem["severity"] == severity && parts.iter().all(|part| message.contains(part))
        };
        let found = { problems }.find(is_meant);
        let found = found.unwrap_or_else(|| panic!("no {severity} {parts:?} in {:#}", self.json["problems"]));
        if !frames.is_empty() {
            assert_eq!(found["frames"], json!(frames), "{found:#}");
        }
    }

    pub(crate) fn expect_no_alarm(&self) {
        assert_eq!(self.code, 0, "{}", self.stderr);
        assert_eq!(self.of_severity("error"), [""; 0]);
        assert_eq!(self.of_severity("warning"), [""; 0]);
    }
}

/// Multiplies column `column` of a matrix.
pub(crate) fn scale_column(matrix: &mut Value, column: usize, factor: f64) {
    for row in 0..3 {
        matrix[row][column] = json!(matrix[row][column].as_f64().expect("a number") * factor);
    }
}
