//! What `nerf info` says of depth files, and whether `nerf train` agrees.

use super::toys::{Result, Toys, info};
use crate::program::{SMOKE, nerf};
use image::{GrayImage, ImageBuffer, Luma, Rgb, RgbImage};
use nerf::capture::image_file::read_exr_channel;
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use serde_json::{Value, json};
use std::path::Path;

const SIZE: u32 = 64;
/// As when depth is trained on.
const USED: [&str; 2] = ["--set", "loss.depth=1"];

/// Toys whose depth files `write` writes anew, with the extension; it is told world units, 0 where nothing is.
fn with_depth(extension: &str, write: impl Fn(&Path, &[f32])) -> Toys {
    let toys = Toys::new();
    for split in ["train", "val", "test"] {
        toys.edit(split, |file| {
            for frame in file["frames"].as_array_mut().expect("a list") {
                let name = frame["depth_file_path"].as_str().expect("a name").to_owned();
                let depth = read_exr_channel(&toys.path().join(&name), "Z").expect("depth").2;
                let name = name.replace(".exr", &format!(".{extension}"));
                write(&toys.path().join(&name), &depth);
                frame["depth_file_path"] = json!(name);
            }
        });
    }
    toys
}

/// Writes depth in steps, of which a world unit has so many; `far` where nothing is.
fn steps(per_unit: f32, far: u16) -> impl Fn(&Path, &[f32]) {
    move |path, depth| {
        let step = |z: &f32| if *z > 0.0 { (z * per_unit) as u16 } else { far };
        let picture =
            ImageBuffer::<Luma<u16>, Vec<u16>>::from_raw(SIZE, SIZE, depth.iter().map(step).collect());
        picture.expect("all pixels").save(path).expect("writable");
    }
}

/// Writes floats as `.npy`, `far` where nothing is.
fn npy(far: f32) -> impl Fn(&Path, &[f32]) {
    move |path, depth| {
        let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (64, 64), }";
        let numbers = depth.iter().flat_map(|&z| if z > 0.0 { z } else { far }.to_le_bytes());
        let begin = [&b"\x93NUMPY\x01\x00"[..], &(header.len() as u16).to_le_bytes(), header.as_bytes()];
        std::fs::write(path, begin.concat().into_iter().chain(numbers).collect::<Vec<u8>>())
            .expect("writable");
    }
}

fn part(json: &Value, key: &str) -> f64 {
    json["depth"][key].as_f64().expect("a part")
}

/// Expects the warning without `loss.depth`, and the error and the failure of training with it.
fn expect_failure(toys: &Toys, parts: &[&str]) {
    toys.info().expect(0, "warning", parts, &[]);
    let used = info(&toys.path(), &USED);
    used.expect(1, "error", parts, &[]);
    train(toys).code(1).stderr(contains(parts[parts.len() - 1]));
}

fn train(toys: &Toys) -> assert_cmd::assert::Assert {
    let run = toys.folder.path().join("run");
    let args = ["train", "--config", SMOKE, "--steps", "2", "--no-eval", "--overwrite", "--out"];
    nerf().args(args).arg(run).args(USED).arg(toys.path()).assert()
}

#[test]
fn depth_in_the_units_of_the_poses_raises_no_alarm() {
    let toys = Toys::new();
    let result: Result = info(&toys.path(), &USED);
    result.expect_no_alarm();
    assert_eq!((&result.json["depth"]["files"], part(&result.json, "far")), (&json!(24), 0.0));
    let known = part(&result.json, "known");
    assert!((0.1..0.6).contains(&known), "{known}");
    let millimetres = with_depth("png", steps(1000.0, 0));
    let result = info(&millimetres.path(), &USED);
    result.expect_no_alarm();
    assert!((part(&result.json, "known") - known).abs() < 0.01);
}

#[test]
fn inverse_depth_is_told() {
    let inverse = |path: &Path, depth: &[f32]| {
        let invert = |z: &f32| if *z > 0.0 { 7.0 / z } else { 0.0 };
        npy(0.0)(path, &depth.iter().map(invert).collect::<Vec<_>>());
    };
    let result = with_depth("npy", inverse).info();
    result.expect(0, "warning", &["depth is probably inverse (disparity)", "export depth itself"], &[]);
    let said = result.of_severity("warning").concat();
    let factor = said.split(" / value").next().and_then(|before| before.rsplit(' ').next());
    let factor: f64 = factor.expect("a factor").parse().expect("a number");
    assert!((factor / 7.0 - 1.0).abs() < 0.05, "{said}");
}

#[test]
fn stand_ins_for_far_away_are_counted() {
    let known = part(&Toys::new().info().json, "known");
    for toys in [
        with_depth("png", steps(1000.0, u16::MAX)),
        with_depth("npy", npy(1e10)),
        with_depth("npy", npy(f32::INFINITY)),
        with_depth("npy", npy(10.0)),
    ] {
        let result = info(&toys.path(), &USED);
        result.expect_no_alarm();
        let [found, far] = ["known", "far"].map(|key| part(&result.json, key));
        assert!((found - known).abs() < 0.01 && (far - (1.0 - known)).abs() < 0.02, "{found} {far}, {known}");
    }
    let toys = with_depth("npy", npy(1e10));
    let said = contains("of the values stand for far away");
    nerf()
        .arg("info")
        .arg(toys.path())
        .assert()
        .success()
        .stdout(said.clone().and(contains("24 files read")));
    train(&toys).success().stderr(said.and(contains("depth: known in")));
    expect_failure(
        &with_depth("npy", |path, depth| npy(1e10)(path, &vec![0.0; depth.len()])),
        &["no pixel of the training photos has a known depth"],
    );
}

#[test]
fn files_that_training_could_not_use_are_named() {
    let colors = with_depth("png", |path, depth| {
        let color = |x, y| Rgb([(40.0 * depth[(y * SIZE + x) as usize]) as u8, 90, 200]);
        RgbImage::from_fn(SIZE, SIZE, color).save(path).expect("writable");
    });
    expect_failure(
        &colors,
        &["24 depth files cannot be used", "train/0000_depth.png", "found one in colours"],
    );
    let wide = with_depth("png", |path, _| GrayImage::new(SIZE, SIZE / 2).save(path).expect("writable"));
    expect_failure(&wide, &["24 depth files cannot be used", "the aspect of its photo, 64x64, found 64x32"]);
    let torn = with_depth("npy", |path, _| std::fs::write(path, "\u{93}NUMPY").expect("writable"));
    expect_failure(&torn, &["24 depth files cannot be used", "NumPy's .npy"]);
    let bytes = with_depth("png", |path, depth| {
        let grey = |x, y| Luma([(40.0 * depth[(y * SIZE + x) as usize]) as u8]);
        GrayImage::from_fn(SIZE, SIZE, grey).save(path).expect("writable");
    });
    bytes.info().expect(0, "warning", &["24 depth files have 8 bits"], &[]);
    let none = with_depth("png", |path, _| {
        std::fs::remove_file(path.with_extension("exr")).expect("removed");
    });
    none.info().expect(0, "warning", &["depth file is missing"], &[]);
    info(&none.path(), &USED).expect(1, "error", &["no training frame has a depth file"], &[]);
}

/// Expects a warning that advises this factor, within 3 %.
fn expect_factor(toys: &Toys, factor: f64) {
    let result = toys.info();
    result.expect(0, "warning", &["probably in other units than the poses"], &[]);
    let said = result.of_severity("warning").join(" ");
    let advised = said.split("`depth_unit_scale_factor` ").nth(1).expect("the remedy");
    let advised: f64 = advised.split(' ').next().and_then(|number| number.parse().ok()).expect("a number");
    assert!((advised / factor - 1.0).abs() < 0.03, "{said}");
}

#[test]
fn other_units_are_told_with_the_factor() {
    let toys = with_depth("png", steps(200.0, 0));
    expect_factor(&toys, 0.005);
    train(&toys).success().stderr(contains("probably in other units"));
    for split in ["train", "val", "test"] {
        toys.edit(split, |file| file["depth_unit_scale_factor"] = json!(0.005));
    }
    toys.info().expect_no_alarm();
    // Floats in millimetres: all beyond the box.
    let toys = with_depth("npy", |path, depth| {
        npy(0.0)(path, &depth.iter().map(|z| 1000.0 * z).collect::<Vec<_>>());
    });
    expect_factor(&toys, 0.001);
    info(&toys.path(), &USED).expect(1, "error", &["no pixel of the training photos has a known depth"], &[]);
    for split in ["train", "val", "test"] {
        toys.edit(split, |file| file["depth_unit_scale_factor"] = json!(0.001));
    }
    info(&toys.path(), &USED).expect_no_alarm();
}
