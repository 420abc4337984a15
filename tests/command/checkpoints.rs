//! Checkpoints as files: those that are damaged, and those before them.

use crate::program::{SMOKE, checkpoint, generated, object, place, quietly, text, train};
use predicates::prelude::*;
use predicates::str::contains;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

static TOYS: LazyLock<PathBuf> =
    LazyLock::new(|| generated("toys", "few_toys", &["--views", "6", "--size", "16", "--samples", "1"]));

/// The checkpoints in a run's folder, by name.
fn checkpoints(run: &Path) -> Vec<String> {
    let entries = fs::read_dir(run).expect("a folder").map(|entry| entry.expect("an entry").file_name());
    let mut names: Vec<_> = entries.map(|name| name.to_string_lossy().into_owned()).collect();
    names.retain(|name| name.contains("checkpoint") || name.starts_with('.'));
    names.sort();
    names
}

#[test]
fn the_checkpoint_before_is_kept_and_used_where_the_newest_is_damaged() {
    let run = place("kept");
    train(&TOYS, &run, &["--no-eval", "--steps", "48", "--checkpoint-every", "0"]);
    let newest = run.join("checkpoint.safetensors");
    assert_eq!(checkpoints(&run), ["checkpoint-32.safetensors", "checkpoint.safetensors"]);
    let mut bytes = fs::read(&newest).expect("a checkpoint");
    let middle = bytes.len() / 2;
    bytes[middle..middle + 4096].fill(0);
    fs::write(&newest, &bytes).expect("writable");
    let says = || contains("is damaged").and(contains("checkpoint-32.safetensors of step 32"));
    let out = place("views");
    let commands = [
        &["render", text(&run), "--orbit", "1", "--width", "8", "--out", text(&out)][..],
        &["eval", text(&run), text(&TOYS)],
        &["report", text(&run)],
    ];
    for args in commands {
        let mut command = crate::program::nerf();
        command.args(args).assert().success().stderr(says().and(contains("the tensor '")));
    }
    quietly(&["eval", text(&newest), text(&TOYS)]).assert().code(1).stderr(contains("is damaged"));
    let args = ["train", text(&TOYS), "--out", text(&run), "--resume", "--steps", "64", "--no-eval"];
    let mut command = crate::program::nerf();
    command.args(args).args(["--checkpoint-every", "0", "--keep", "3"]).assert().success().stderr(says());
    let kept = ["checkpoint-32.safetensors", "checkpoint-48.safetensors", "checkpoint.safetensors"];
    assert_eq!(checkpoints(&run), kept);
    assert_eq!(checkpoint(&run).state.step, 64);
    let before = fs::read(&newest).expect("a checkpoint");
    let result = object(&[&args[..], &["--keep", "1"]].concat());
    assert_eq!((result["steps"].as_u64(), fs::read(&newest).expect("there") == before), (Some(64), true));
    quietly(&["train", text(&TOYS), "--out", text(&run), "--overwrite", "--steps", "8", "--config", SMOKE])
        .assert()
        .success();
    assert_eq!(checkpoints(&run), ["checkpoint.safetensors"]);
}
