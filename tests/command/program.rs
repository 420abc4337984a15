//! Driving the program from end to end: places for what it writes, datasets, training runs and what they say.

use assert_cmd::Command;
use nerf::field::checkpoint::Checkpoint;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// The preset of training runs that take seconds.
pub(crate) const SMOKE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/smoke.json");

pub(crate) fn nerf() -> Command {
    assert_cmd::cargo::cargo_bin_cmd!("nerf")
}

/// Without what it would say of its progress.
pub(crate) fn quietly(args: &[&str]) -> Command {
    let mut command = nerf();
    command.args(args).arg("--quiet");
    command
}

/// The only JSON value on the stdout of a command, which ends with this code.
pub(crate) fn answer(command: &mut Command, code: i32) -> Value {
    let assert = command.arg("--json").assert().code(code);
    serde_json::from_slice(&assert.get_output().stdout).expect("one JSON value")
}

/// The JSON object that a command prints.
pub(crate) fn object(args: &[&str]) -> Value {
    answer(&mut quietly(args), 0)
}

pub(crate) fn text(path: &Path) -> &str {
    path.to_str().expect("a path in UTF-8")
}

/// How long a folder lies untouched before its process counts as gone.
const UNUSED: Duration = Duration::from_secs(15 * 60);

/// The folder of this process alone: other checkouts may use the same target folder at the same time. Tests share what
/// lies in it, so none of them can remove it; a later run does.
static PLACES: LazyLock<PathBuf> = LazyLock::new(|| {
    let all = Path::new(env!("CARGO_TARGET_TMPDIR")).join("places");
    fs::create_dir_all(&all).expect("writable");
    for old in fs::read_dir(&all).expect("readable").flatten() {
        let modified = old.metadata().and_then(|data| data.modified()).ok();
        if modified.and_then(|time| time.elapsed().ok()).is_some_and(|unused| unused > UNUSED) {
            let _ = fs::remove_dir_all(old.path());
        }
    }
    tempfile::tempdir_in(&all).expect("writable").keep()
});

/// A path of this name at which there is nothing yet, another one at every call.
pub(crate) fn place(name: &str) -> PathBuf {
    static COUNT: AtomicUsize = AtomicUsize::new(0);
    let parent = PLACES.join(COUNT.fetch_add(1, Ordering::Relaxed).to_string());
    fs::create_dir(&parent).expect("writable");
    parent.join(name)
}

pub(crate) fn generated(scene: &str, name: &str, further: &[&str]) -> PathBuf {
    let path = place(name);
    let args = [&["generate", scene, "--out", text(&path)], further].concat();
    quietly(&args).assert().success();
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
