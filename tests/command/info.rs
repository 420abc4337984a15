//! `nerf info`: healthy datasets raise no alarm, and each kind of damage is named with what to do.

mod depth;
mod files;
mod masks;
mod scene_box;
mod toys;

use crate::program::nerf;
use crate::support::shared;
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use serde_json::{Value, json};
use std::fs;
use toys::{Toys, info, scale_column};

#[test]
fn a_healthy_dataset_is_told_in_full() {
    let toys = Toys::new();
    let result = toys.info();
    result.expect_no_alarm();
    let json = &result.json;
    assert_eq!(json["dialect"], "blender");
    assert_eq!([&json["frames"], &json["found"], &json["cameras"]], [24, 24, 1]);
    let corner = |key: &str| -> Vec<f64> {
        json["box"][key].as_array().expect("a list").iter().map(|v| v.as_f64().expect("a number")).collect()
    };
    let (min, max) = (corner("min"), corner("max"));
    assert!(min.len() == 3 && max.len() == 3 && (0..3).all(|axis| min[axis] < -0.5 && max[axis] > 0.5));
    for key in ["host_bytes", "device_bytes"] {
        assert!(json["memory"][key].as_u64().is_some_and(|bytes| bytes > 1 << 20), "{key}");
    }
    let focal = json["optics"]["focal_px"]["x"]["median"].as_f64().expect("a number");
    assert!((focal - 87.9).abs() < 0.1, "{focal}");
    let fov = json["optics"]["fov_degrees"]["y"]["median"].as_f64().expect("a number");
    assert!((fov - 40.0).abs() < 0.01, "{fov}");
    assert_eq!((&json["gaze"]["seeing"], &json["gaze"]["axes_meet"]), (&json!(1.0), &json!(true)));
    assert_eq!(json["photos"]["looked_at"], 24);
    assert_eq!(json["images"]["with_depth"], 24);
    let text = nerf().arg("info").arg(toys.path()).assert().success();
    text.stdout(contains("24 listed, 24 found").and(contains("nothing looks wrong")).and(contains("40.0°")));
}

#[test]
fn real_datasets_raise_no_false_alarm() {
    for (name, warnings) in [
        ("lego_100", &[][..]),
        // Its `aabb_scale` of 16 leaves out the background; 64 is better.
        ("stitch_200", &["30 % of what the photos show seems to lie beyond the scene box"]),
        ("fox_270x480", &["17 of 67 listed images are missing"]),
        (
            "nerfstudio_lego_test",
            &["there is a single image to train on", "1 frame shows the same picture as another frame"],
        ),
        ("brush_test_dataset", &["`fl_x` is 50.00", "`fl_y` is 50.00", "there is a single image"]),
    ] {
        let Some(path) = shared(&format!("data/{name}")) else { return };
        let result = info(&path, &[]);
        assert_eq!(result.code, 0, "{name}: {}", result.stderr);
        let found = result.of_severity("warning");
        assert_eq!(found.len(), warnings.len(), "{name}: {found:#?}");
        for (found, expected) in found.iter().zip(warnings) {
            assert!(found.contains(expected), "{name}: {found}");
        }
    }
}

#[test]
fn poses_read_the_wrong_way_are_told_with_the_remedy() {
    let toys = Toys::new();
    toys.edit_matrices(|matrix| {
        scale_column(matrix, 1, -1.0);
        scale_column(matrix, 2, -1.0);
    });
    let parts = ["OpenCV's axes", "change the sign of the second and third column", "100 %"];
    toys.info().expect(0, "warning", &parts, &[]);
    let toys = Toys::new();
    toys.edit_matrices(|matrix| {
        let pose = |row: usize, column: usize| matrix[row][column].as_f64().expect("a number");
        let inverse = |row: usize| {
            let turned = [pose(0, row), pose(1, row), pose(2, row)];
            let moved: f64 = (0..3).map(|axis| turned[axis] * pose(axis, 3)).sum();
            json!([turned[0], turned[1], turned[2], -moved])
        };
        *matrix = json!([inverse(0), inverse(1), inverse(2), [0.0, 0.0, 0.0, 1.0]]);
    });
    toys.info().expect(0, "warning", &["may be world-to-camera:", "write the inverse of every"], &[]);
}

#[test]
fn rolled_pictures_are_noted() {
    let toys = Toys::new();
    toys.edit("train", |file| {
        for frame in file["frames"].as_array_mut().expect("a list").iter_mut().skip(12) {
            for row in frame["transform_matrix"].as_array_mut().expect("rows").iter_mut().take(3) {
                row.as_array_mut().expect("numbers").swap(0, 1);
            }
            scale_column(&mut frame["transform_matrix"], 0, -1.0);
        }
    });
    let result = toys.info();
    result.expect(0, "note", &["of 24 pictures are rolled by more than 45°", "turn them back"], &[]);
    assert_eq!(result.of_severity("warning"), [""; 0]);
}

#[test]
fn stray_cameras_are_named() {
    let toys = Toys::new();
    toys.edit("train", |file| file["frames"][5]["transform_matrix"][0][3] = json!(300.0));
    let result = toys.info();
    result.expect(
        0,
        "warning",
        &["1 camera is far from all others: 300", "check or drop"],
        &["./train/0005"],
    );
    let toys = Toys::new();
    toys.edit("train", |file| {
        scale_column(&mut file["frames"][3]["transform_matrix"], 0, -1.0);
        scale_column(&mut file["frames"][3]["transform_matrix"], 2, -1.0);
    });
    let result = toys.info();
    result.expect(0, "warning", &["1 camera is turned away", "by 180°"], &["./train/0003"]);
    let parts = ["1 of 24 cameras see nothing of the scene box", "aabb"];
    result.expect(0, "warning", &parts, &["./train/0003"]);
}

#[test]
fn a_mirrored_pose_is_passed_on() {
    let toys = Toys::new();
    toys.edit("train", |file| scale_column(&mut file["frames"][2]["transform_matrix"], 0, -1.0));
    toys.info().expect(0, "warning", &["1 of the frames is mirrored", "./train/0002"], &[]);
}

#[test]
fn frames_given_twice_are_told() {
    let toys = Toys::new();
    toys.edit("train", |file| {
        file["frames"][4]["transform_matrix"] = file["frames"][9]["transform_matrix"].clone();
    });
    let parts =
        ["2 frames share their pose", "./train/0009 is where ./train/0004 is", "their pictures differ"];
    toys.info().expect(0, "warning", &parts, &["./train/0004", "./train/0009"]);
    let without = info(&toys.path(), &["--no-photos"]);
    without.expect(0, "note", &["2 frames share their pose", "unless the camera stood still"], &[]);
    let toys = Toys::new();
    fs::copy(toys.photo(7), toys.photo(11)).expect("writable");
    let parts = ["1 frame shows the same picture", "./train/0011 is ./train/0007, with different poses"];
    toys.info().expect(0, "warning", &parts, &["./train/0011"]);
}

#[test]
fn cameras_that_tell_no_distances_are_told() {
    let toys = Toys::new();
    toys.edit_matrices(|matrix| {
        for row in 0..3 {
            matrix[row][3] = json!(0.0);
        }
    });
    toys.info().expect(0, "warning", &["all 24 cameras are at the same place", "camera-to-world"], &[]);
    let toys = Toys::new();
    for split in ["val", "test"] {
        fs::remove_file(toys.path().join(format!("transforms_{split}.json"))).expect("there");
    }
    toys.edit("train", |file| file["frames"].as_array_mut().expect("a list").truncate(1));
    let result = toys.info();
    result.expect(0, "warning", &["there is a single image", "add photos from other places"], &[]);
    assert_eq!([&result.json["frames"], &result.json["found"]], [1, 1]);
}

#[test]
fn missing_images_are_told_and_fail_when_none_is_left() {
    let toys = Toys::new();
    fs::remove_file(toys.photo(0)).expect("there");
    let result = toys.info();
    result.expect(0, "warning", &["1 of 24 listed images", "train/0000"], &[]);
    assert_eq!([&result.json["frames"], &result.json["found"]], [24, 23]);
    fs::write(toys.photo(1), "").expect("writable");
    let text = nerf().arg("info").arg(toys.path()).assert().code(1);
    text.stdout(contains("24 listed, 22 usable, 2 missing or unreadable"));
    for split in ["train", "val", "test"] {
        for entry in fs::read_dir(toys.path().join(split)).expect("readable") {
            fs::remove_file(entry.expect("readable").path()).expect("there");
        }
    }
    let result = toys.info();
    result.expect(
        1,
        "error",
        &["24 of 24 listed images are missing", "put the images where `file_path` says"],
        &[],
    );
    assert_eq!([&result.json["frames"], &result.json["found"], &result.json["cameras"]], [24, 0, 1]);
    assert!(result.json["box"]["max"][2].is_number() && result.json["memory"]["device_bytes"].is_u64());
    assert!(result.stderr.contains("training would fail: 24 of 24 listed"), "{}", result.stderr);
    let text = nerf().arg("info").arg(toys.path()).assert().code(1);
    text.stdout(contains("training would fail; 1 error"))
        .stderr("error: training would fail, as the report tells\n");
    let unreadable = nerf().args(["info", "no/such/folder"]).assert().code(1);
    unreadable.stdout("").stderr(contains("no/such/folder does not exist"));
}

#[test]
fn bad_photos_are_named() {
    let toys = Toys::new();
    toys.edit_photo(6, |photo| photo.blur(1.5));
    toys.edit_photo(10, |photo| photo.brighten(-400));
    toys.edit_photo(14, |photo| photo.adjust_contrast(-100.0).brighten(500));
    let result = toys.info();
    result.expect(
        0,
        "warning",
        &["1 photo has far less fine detail", "drop or retake what is blurred"],
        &["./train/0006"],
    );
    result.expect(0, "warning", &["1 photo shows nothing but black"], &["./train/0010"]);
    result.expect(0, "warning", &["1 photo shows nothing but white"], &["./train/0014"]);
    assert!(info(&toys.path(), &["--no-photos"]).of_severity("warning").is_empty());
    // However many there are, a black photo is no number of stops away from others.
    for index in 0..18 {
        toys.edit_photo(index, |photo| photo.brighten(-400));
    }
    let text = nerf().arg("info").arg(toys.path()).output().expect("runs").stdout;
    let text = String::from_utf8(text).expect("text");
    let line = text.lines().find(|line| line.contains("decoded")).expect("about photos");
    assert!(line.contains("stops from the median of those that are not black; 18 are"), "{line}");
    let stops = line.split("brightness ").nth(1).expect("a brightness").split(' ');
    let stops: Vec<f64> = stops.filter_map(|word| word.parse().ok()).filter(|&stop| stop != 18.0).collect();
    assert!(stops.len() == 2 && stops.iter().all(|stop| stop.abs() < 8.0), "{line}");
    let toys = Toys::new();
    toys.edit_photo(8, |photo| {
        let mut dark = photo.to_rgba8();
        dark.pixels_mut().for_each(|pixel| pixel.0[..3].iter_mut().for_each(|value| *value /= 4));
        dark.into()
    });
    let parts = ["the exposure of 1 photo differs", "stops darker"];
    toys.info().expect(0, "warning", &parts, &["./train/0008"]);
    let half = fs::read(toys.photo(12)).expect("readable");
    fs::write(toys.photo(12), &half[..half.len() / 2]).expect("writable");
    toys.info().expect(1, "error", &["train/0012.png"], &["./train/0012"]);
}

#[test]
fn odd_optics_are_named() {
    let toys = Toys::new();
    toys.edit("train", |file| {
        file["frames"][1]["fl_x"] = json!(120.0);
        file["frames"][1]["fl_y"] = json!(120.0);
    });
    let parts =
        ["1 of 24 frames has a focal length unlike the others", "120.0 px instead of 87.9 px (+36.5 %)"];
    toys.info().expect(0, "warning", &parts, &["./train/0001"]);
    let toys = Toys::new();
    toys.edit("train", |file| {
        for (key, value) in
            [("fl_x", 900.0), ("fl_y", 90.0), ("cx", 60.0), ("cy", 32.0), ("w", 64.0), ("h", 64.0)]
        {
            file[key] = json!(value);
        }
    });
    let result = toys.info();
    result.expect(0, "warning", &["pixels are not square in", "900.0 px along x and 90.0 px along y"], &[]);
    result.expect(0, "warning", &["the principal point is far off the middle", "60, 32 of 64x64"], &[]);
    toys.edit("train", |file| file["fl_y"] = json!(900.0));
    toys.info().expect(0, "warning", &["the field of view is 4.1° x 4.1°", "radians"], &[]);
}

#[test]
fn what_cannot_be_trained_on_fails_with_one_object() {
    let toys = Toys::new();
    fs::write(toys.path().join("transforms_train.json"), "{\"frames\": [").expect("writable");
    let result = toys.info();
    result.expect(1, "error", &["transforms_train.json"], &[]);
    for key in ["dialect", "frames", "found", "cameras", "box", "memory", "problems"] {
        assert!(result.json.get(key).is_some(), "{key}");
    }
    fs::remove_file(toys.path().join("transforms_train.json")).expect("there");
    toys.info().expect(1, "error", &["there is no frame to train on", "name the folder"], &[]);
    let nowhere = info(&toys.path().join("nowhere"), &[]);
    nowhere.expect(1, "error", &["nowhere does not exist"], &[]);
    assert!(["frames", "found", "cameras"].iter().all(|key| nowhere.json[key].is_null()), "{}", nowhere.json);
}

#[test]
fn no_adapter_is_needed() {
    let toys = Toys::new();
    let without = |args: &[&str]| {
        let mut command = nerf();
        command.env("VK_DRIVER_FILES", "/nowhere.json").env("VK_ICD_FILENAMES", "/nowhere.json").args(args);
        command
    };
    if without(&["adapters"]).output().expect("runs").status.success() {
        eprintln!("skipped: this machine's adapter cannot be hidden");
        return;
    }
    let output = without(&["info", "--json"]).arg(toys.path()).assert().success().get_output().stdout.clone();
    let json: Value = serde_json::from_slice(&output).expect("one JSON object");
    assert!(json["memory"]["device_bytes"].as_u64().is_some_and(|bytes| bytes > 100 << 20));
    assert!(json["problems"].to_string().contains("there is no adapter on this machine"));
    without(&["info", "--adapter", "0"]).arg(toys.path()).assert().code(1);
}

#[test]
fn cameras_are_drawn() {
    let toys = Toys::new();
    toys.edit("train", |file| file["frames"][5]["transform_matrix"][0][3] = json!(300.0));
    let svg = toys.folder.path().join("map.SVG");
    let result = info(&toys.path(), &["--plot", &svg.to_string_lossy()]);
    assert_eq!((result.code, &result.json["plot"]), (0, &json!(svg.to_string_lossy())));
    let text = fs::read_to_string(&svg).expect("readable");
    for part in
        ["<svg", "from above: x to the right, y up", "0005 (", "19 train", "1 to check", "world units"]
    {
        assert!(text.contains(part), "{part}");
    }
    assert_eq!(text.matches("<text").count(), text.matches("</text>").count());
    let marked = text.lines().filter(|shape| shape.contains("\"#d55e00\"")).count();
    assert!(marked > 4, "{marked} shapes of the stray camera");
    let png = nerf().args(["info", "--plot", "map.png"]).arg(toys.path()).assert().code(2);
    png.stdout("").stderr(contains("expected a name that ends in .svg, found 'map.png'; name an SVG file"));
}
