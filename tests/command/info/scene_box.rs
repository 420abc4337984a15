//! Boxes that hold what the photos show, and boxes that do not.

use super::toys::info;
use crate::program::nerf;
use crate::support::folder;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

/// A yard among columns and walls that are 5 away from its middle at most.
fn courtyard(folder: &Path) -> PathBuf {
    let path = folder.join("courtyard");
    let scene =
        ["generate", "courtyard", "--views", "40", "--size", "96", "--samples", "1", "--quiet", "--out"];
    nerf().args(scene).arg(&path).assert().success();
    path
}

/// States a box that reaches so far to each side of the origin.
fn state_box(dataset: &Path, half: f64) {
    for split in ["train", "val", "test"] {
        let path = dataset.join(format!("transforms_{split}.json"));
        let text = fs::read_to_string(&path).expect("readable");
        let mut file: Value = serde_json::from_str(&text).expect("JSON");
        file["aabb"] = json!([-half, half].map(|corner| [corner; 3]));
        fs::write(path, file.to_string()).expect("writable");
    }
}

#[test]
fn a_box_that_cuts_off_what_the_photos_show_is_told() {
    let folder = folder();
    let dataset = courtyard(folder.path());
    info(&dataset, &[]).expect_no_alarm();
    state_box(&dataset, 3.0);
    let parts = [
        "of what the photos show seems to lie beyond the scene box",
        "reaches 3.00 to each side of its centre",
        "write `aabb`: [[-3.00, -3.00, -3.00], [3.00, 3.00, 3.00]] and `aabb_scale`: 2 into the file",
    ];
    info(&dataset, &[]).expect(0, "warning", &parts, &[]);
    assert_eq!(info(&dataset, &["--no-photos"]).of_severity("warning"), [""; 0]);
    let run = || {
        let out = folder.path().join("run");
        let mut train = nerf();
        train.arg("train").arg(&dataset).args(["--steps", "2", "--no-eval", "--overwrite"]);
        train.arg("--out").arg(out).output().expect("runs")
    };
    let told = |output: &Output| {
        assert!(output.status.success(), "{output:?}");
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        text.lines().filter(|line| line.starts_with("warning: ") && line.contains(parts[2])).count()
    };
    assert_eq!(told(&run()), 1, "once");
    state_box(&dataset, 6.0);
    info(&dataset, &[]).expect_no_alarm();
    assert_eq!(told(&run()), 0);
}
