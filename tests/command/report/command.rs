//! `nerf train` and `nerf report` write the page.

use super::assert_stands_alone;
use super::browser::look_at;
use crate::program::{answer, nerf, quietly};
use crate::support::folder;
use serde_json::Value;
use std::fs;
use std::path::Path;

fn succeeds(folder: &Path, args: &[&str]) -> Value {
    answer(quietly(args).current_dir(folder), 0)
}

fn fails(folder: &Path, args: &[&str]) -> String {
    answer(quietly(args).current_dir(folder), 1)["error"].as_str().expect("an error").to_owned()
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
    let folder = folder();
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

    let html = train(&["--steps", "40", "--resume", "--eval-all"]);
    assert!(
        html.contains("resuming at step 20") && html.contains("measuring test views at the end"),
        "{html}"
    );
    assert!(html.contains("toys</h1>") && html.contains("All settings") && html.contains("log2_table"));
    let pictures = html.matches("<img ").count();
    assert!(pictures > 0 && pictures.is_multiple_of(4));
    if let Some(found) = look_at(&html) {
        assert_eq!((&found["phone"]["decoded"], &found["phone"]["overflow"]), (&pictures.into(), &0.into()));
    }

    let again = succeeds(here, &["report", "run"]);
    assert_eq!(again["report"], "run/report.html");
    assert_eq!(again["views"].as_u64(), Some(pictures as u64 / 4), "{again}");
    assert_eq!((again["steps"].as_u64(), &again["without_views"]), (Some(40), &Value::Null), "{again}");
    let same = take(&page);
    let scores = |html: &str| html[html.find("<table class=\"scores\"").expect("scores")..].to_owned();
    let scores = |html: &str| scores(html).split("</table>").next().map(str::to_owned);
    assert_eq!(scores(&same), scores(&html), "from the checkpoint as from the run");

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
    for checkpoint in ["checkpoint.safetensors", "checkpoint-20.safetensors"] {
        fs::remove_file(here.join("run").join(checkpoint)).expect("removable");
    }
    let saved_nothing = succeeds(here, &["report", "run"]);
    assert!(saved_nothing["without_views"].as_str().expect("a reason").contains("checkpoint.safetensors"));
    assert!(take(page).contains("log2_table"), "the settings are in config.json");
    fs::remove_file(&log).expect("removable");
    assert!(fails(here, &["report", "run"]).contains("nerf train --out"));
    assert!(fails(here, &["report", "missing"]).contains("expected the folder"));
}

/// The rows of a run's log that tell of test views.
fn measurements(run: &Path) -> Vec<Value> {
    let log = fs::read_to_string(run.join("log.jsonl")).expect("a log");
    let rows = log.lines().map(|line| serde_json::from_str::<Value>(line).expect("a row"));
    rows.filter(|row| row.get("eval_psnr").is_some()).collect()
}

#[test]
fn measuring_takes_no_longer_than_a_tenth_of_the_training() {
    let folder = folder();
    let here = folder.path();
    succeeds(here, &["generate", "toys", "--views", "24", "--size", "32", "--samples", "1", "--out", "toys"]);
    let train = |run: &str, more: &[&str]| {
        let result =
            succeeds(here, &[&["train", "toys", "--out", run, "--steps", "2"], &TINY[..], more].concat());
        let [row] = &measurements(&here.join(run))[..] else { panic!("measured once") };
        for key in ["views", "views_left_out", "near_share"] {
            assert_eq!(result[key], row[key], "{key} in {row}");
        }
        assert!(result["near_share"].as_f64().is_some_and(|share| (0.0..=1.0).contains(&share)), "{result}");
        ["views", "views_left_out"].map(|key| result[key].as_u64().expect("a number"))
    };
    let [all, left_out] = train("all", &["--eval-all", "--eval-every", "1000"]);
    assert!(all > 2 && left_out == 0, "{all} {left_out}");
    assert_eq!(train("deterministic", &["--deterministic"]), [all, 0], "the clock has no say");
    // Two steps take no ten times as long as a view.
    assert_eq!(train("short", &[]), [1, all - 1]);
    let html = fs::read_to_string(here.join("short/report.html")).expect("a page");
    assert!(html.contains(&format!("PSNR of 1 of {all} test views")));
    let output = quietly(&["train", "toys", "--out", "none", "--eval-all", "--no-eval"])
        .current_dir(here)
        .assert()
        .code(2);
    assert!(String::from_utf8_lossy(&output.get_output().stderr).contains("--no-eval"));

    let report = succeeds(here, &["report", "short"]);
    let eval = succeeds(here, &["eval", "short", "toys"]);
    assert_eq!((&report["views"], &report["views_left_out"]), (&all.into(), &0.into()));
    assert_eq!(eval["views"].as_array().map(Vec::len), Some(all as usize));
    assert_eq!(report["near_share"], eval["near_share"]);
    assert!(eval["near_share"].is_f64() && eval["views"][0]["near_share"].is_f64(), "{eval}");
}

#[test]
fn without_a_focus_the_near_share_is_not_told() {
    let folder = folder();
    let here = folder.path();
    succeeds(here, &["generate", "toys", "--views", "8", "--size", "16", "--samples", "1", "--out", "toys"]);
    // All cameras look the same way.
    for split in ["train", "val", "test"] {
        let file = here.join(format!("toys/transforms_{split}.json"));
        let text = fs::read_to_string(&file).expect("a dataset");
        let mut dataset: Value = serde_json::from_str(&text).expect("JSON");
        for (number, frame) in dataset["frames"].as_array_mut().expect("frames").iter_mut().enumerate() {
            let x = number as f64 / 4.0;
            frame["transform_matrix"] =
                serde_json::json!([[1, 0, 0, x], [0, 1, 0, 0.5], [0, 0, 1, 4], [0, 0, 0, 1]]);
        }
        fs::write(&file, dataset.to_string()).expect("writable");
    }
    let trained = succeeds(here, &[&["train", "toys", "--out", "run", "--steps", "2"], &TINY[..]].concat());
    let eval = succeeds(here, &["eval", "run", "toys"]);
    let report = succeeds(here, &["report", "run"]);
    for result in [&trained, &eval, &report, &eval["views"][0]] {
        assert!(result["psnr"].is_f64() && result["near_share"].is_null(), "{result}");
    }
    let html = take(&here.join("run/report.html"));
    assert!(html.contains("do not cross in one point") && !html.contains("Fog: "));
    let text = nerf().current_dir(here).args(["eval", "run", "toys"]).assert();
    assert!(String::from_utf8_lossy(&text.get_output().stdout).contains("near share not told"));
}
