//! Scores leave out what masks ignore.

use std::path::Path;

use crate::program::nerf;
use crate::support::folder;
use image::{GrayImage, Luma};
use serde_json::Value;

/// The JSON object that a command prints, and what it says beside.
fn told(folder: &Path, args: &[&str]) -> (Value, String) {
    let output = nerf().current_dir(folder).arg("--json").args(args).assert().success().get_output().clone();
    let result = serde_json::from_slice(&output.stdout).expect("one JSON object");
    (result, String::from_utf8_lossy(&output.stderr).into_owned())
}

fn mask(folder: &Path, name: &str, is_black: impl Fn(u32) -> bool) {
    let path = folder.join("toys/masks/test").join(name);
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
    let mask = GrayImage::from_fn(24, 24, |x, _| Luma([if is_black(x) { 0 } else { 255 }]));
    mask.save(path).expect("writable");
}

/// The mean squared error of a view.
fn error(result: &Value, view: usize) -> f64 {
    10f64.powf(-0.1 * result["views"][view]["psnr"].as_f64().expect("a number"))
}

#[test]
fn masked_pixels_are_not_measured() {
    let folder = folder();
    let here = folder.path();
    told(here, &["generate", "toys", "--views", "24", "--size", "24", "--samples", "1", "--out", "toys"]);
    let tiny = "grid.log2_table=10 batch.samples=4096 batch.kept=2048";
    let mut train = vec!["train", "toys", "--out", "run", "--steps", "3", "--no-eval", "--max-images", "5"];
    train.extend(tiny.split(' ').flat_map(|setting| ["--set", setting]));
    let (_, said) = told(here, &train);
    assert!(
        said.contains("frames are trained on, evenly spaced") && said.contains("5 views to train on"),
        "{said}"
    );

    let (all, _) = told(here, &["eval", "run", "toys"]);
    let count = all["views"].as_array().expect("a list").len();
    assert!(count >= 3 && all["views"][0]["ignored"].is_null(), "{all}");

    mask(here, "0000.png", |x| x < 8);
    let (right, _) = told(here, &["eval", "run", "toys"]);
    assert_eq!(right["views"][0]["ignored"], 8 * 24);
    assert_eq!(right["views"][1], all["views"][1], "views without a mask stay as they are");
    let (left, _) = told(here, &["eval", "run", "toys", "--invert-masks"]);
    assert_eq!(left["views"][0]["ignored"], 16 * 24);
    let parts = (error(&left, 0) + 2.0 * error(&right, 0)) / 3.0;
    assert!((parts / error(&all, 0) - 1.0).abs() < 1e-9, "{parts} {}", error(&all, 0));

    mask(here, "0001.png", |_| true);
    let (without, said) = told(here, &["eval", "run", "toys"]);
    assert_eq!(without["views"].as_array().map(Vec::len), Some(count - 1));
    assert!(said.contains("0001 is not measured: its mask ignores every pixel"), "{said}");

    told(here, &["eval", "run", "toys", "--crop", "0,0,4,0", "--downscale", "2", "--save", "views"]);
    assert_eq!(image::image_dimensions(here.join("views/test_0000.png")).expect("a PNG"), (10, 12));
}
