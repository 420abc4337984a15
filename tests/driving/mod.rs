//! Driving the program from end to end: folders of a test run, datasets, trainings and what they say.

use assert_cmd::Command;
use nerf::field::checkpoint::Checkpoint;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// The preset of trainings that take seconds.
pub(crate) const SMOKE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/smoke.json");

pub(crate) fn nerf(args: &[&str]) -> Command {
    let mut command = assert_cmd::cargo::cargo_bin_cmd!("nerf");
    command.args(args).arg("--quiet");
    command
}

pub(crate) fn text(path: &Path) -> &str {
    path.to_str().expect("a path in UTF-8")
}

/// The JSON object that a command prints.
pub(crate) fn object(args: &[&str]) -> Value {
    let assert = nerf(args).arg("--json").assert().success();
    serde_json::from_slice(&assert.get_output().stdout).expect("one JSON value")
}

/// An empty folder of this test run.
pub(crate) fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(env!("CARGO_CRATE_NAME")).join(name);
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(path.parent().expect("has a parent")).expect("writable");
    path
}

pub(crate) fn generated(scene: &str, name: &str, further: &[&str]) -> PathBuf {
    let path = folder(name);
    let args = [&["generate", scene, "--out", text(&path)], further].concat();
    nerf(&args).assert().success();
    path
}

/// Trains with the smoke preset and returns what was printed; what is measured does not depend on the clock.
pub(crate) fn train(dataset: &Path, run: &Path, further: &[&str]) -> Value {
    let args = ["train", text(dataset), "--out", text(run), "--config", SMOKE];
    let all: &[&str] = if further.contains(&"--no-eval") { &[] } else { &["--eval-all"] };
    object(&[&args, further, all].concat())
}

pub(crate) fn rows(run: &Path) -> Vec<Value> {
    let log = fs::read_to_string(run.join("log.jsonl")).expect("a log");
    log.lines().map(|line| serde_json::from_str(line).expect("a JSON object per line")).collect()
}

pub(crate) fn checkpoint(run: &Path) -> Checkpoint {
    Checkpoint::load(&run.join("checkpoint.safetensors")).expect("a checkpoint")
}

pub(crate) fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("expected a number, found {value}"))
}
