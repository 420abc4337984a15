//! `nerf train` and `nerf report` write the page.

use crate::assert_stands_alone;
use crate::browser::look_at;
use assert_cmd::Command;
use serde_json::Value;
use std::fs;
use std::path::Path;

fn nerf(folder: &Path) -> Command {
    let mut command = assert_cmd::cargo::cargo_bin_cmd!("nerf");
    command.current_dir(folder).args(["--quiet", "--json"]);
    command
}

fn succeeds(folder: &Path, args: &[&str]) -> Value {
    let output = nerf(folder).args(args).assert().success().get_output().stdout.clone();
    serde_json::from_slice(&output).expect("one JSON object")
}

fn fails(folder: &Path, args: &[&str]) -> String {
    let output = nerf(folder).args(args).assert().code(1).get_output().stdout.clone();
    let result: Value = serde_json::from_slice(&output).expect("one JSON object");
    result["error"].as_str().expect("an error").to_owned()
}

/// The page at `path`, which is removed: the next one must be new.
fn take(path: &Path) -> String {
    let html = fs::read_to_string(path).expect("a page");
    fs::remove_file(path).expect("removable");
    assert_stands_alone(&html);
    html
}

const TINY: [&str; 8] =
    ["--set", "grid.log2_table=10", "--set", "batch.samples=4096", "--set", "batch.kept=2048", "--seed", "3"];

#[test]
fn a_training_leaves_a_page_and_report_writes_it_again() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let here = folder.path();
    let page = here.join("run/report.html");
    succeeds(here, &["generate", "toys", "--views", "6", "--size", "24", "--samples", "1", "--out", "toys"]);
    let train = |more: &[&str]| {
        succeeds(here, &[&["train", "toys", "--out", "run"], &TINY[..], more].concat());
        take(&page)
    };

    let html = train(&["--steps", "20", "--no-eval"]);
    assert!(html.contains("asked for by --no-eval") && html.contains("PSNR of the rays trained on"));
    assert!(!html.contains("<img "));

    let html = train(&["--steps", "40", "--resume"]);
    assert!(html.contains("resuming at step 20") && html.contains("evaluating all test views"), "{html}");
    assert!(html.contains("toys</h1>") && html.contains("All settings") && html.contains("log2_table"));
    let pictures = html.matches("<img ").count();
    assert!(pictures > 0 && pictures.is_multiple_of(3));
    if let Some(found) = look_at(&html) {
        assert_eq!((&found["phone"]["decoded"], &found["phone"]["overflow"]), (&pictures.into(), &0.into()));
    }

    let again = succeeds(here, &["report", "run"]);
    assert_eq!(again["report"], "run/report.html");
    assert_eq!(again["views"].as_u64(), Some(pictures as u64 / 3), "{again}");
    assert_eq!((again["steps"].as_u64(), &again["without_views"]), (Some(40), &Value::Null), "{again}");
    let same = take(&page);
    let scores = |html: &str| html[html.find("<table class=\"scores\"").expect("scores")..].to_owned();
    let scores = |html: &str| scores(html).split("</table>").next().map(str::to_owned);
    assert_eq!(scores(&same), scores(&html), "from the checkpoint as from the training");

    fs::rename(here.join("toys"), here.join("moved")).expect("movable");
    let moved = succeeds(here, &["report", "run", "--out", "elsewhere.html"]);
    assert_eq!(moved["views"], 0);
    let reason = moved["without_views"].as_str().expect("a reason");
    assert!(reason.contains("nerf report run --dataset DATASET") && reason.contains("toys"), "{reason}");
    assert!(take(&here.join("elsewhere.html")).contains("--dataset DATASET") && !page.exists());
    let found = succeeds(here, &["report", "run/checkpoint.safetensors", "--dataset", "moved"]);
    assert_eq!((&found["report"], &found["views"]), (&again["report"], &again["views"]));
    assert!(take(&page).contains("<img "));
    assert!(fails(here, &["report", "run", "--dataset", "nowhere"]).contains("nowhere"));

    odd_folders(here, &page);
}

/// Logs and folders that a crash or a user left behind.
fn odd_folders(here: &Path, page: &Path) {
    let log = here.join("run/log.jsonl");
    let text = fs::read_to_string(&log).expect("a log");
    fs::write(&log, text + "{\"step\": 4").expect("writable");
    succeeds(here, &["report", "run"]);
    assert!(take(page).contains("1 line of the log could not be read"));
    fs::remove_file(here.join("run/checkpoint.safetensors")).expect("removable");
    let saved_nothing = succeeds(here, &["report", "run"]);
    assert!(saved_nothing["without_views"].as_str().expect("a reason").contains("checkpoint.safetensors"));
    assert!(take(page).contains("log2_table"), "the settings are in config.json");
    fs::remove_file(&log).expect("removable");
    assert!(fails(here, &["report", "run"]).contains("nerf train --out"));
    assert!(fails(here, &["report", "missing"]).contains("expected the folder"));
}
