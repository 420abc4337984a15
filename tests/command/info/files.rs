//! Damaged files and masks: all of them are told, and what training would refuse is an error.

use super::toys::{Toys, info};
use serde_json::json;
use std::fs;

impl Toys {
    /// Gives every training frame a mask `masks/<index>.png` that `mask_path` names, all of one colour.
    fn add_masks(&self, grey: u8) {
        let folder = self.path().join("m");
        fs::create_dir_all(&folder).expect("writable");
        self.edit("train", |file| {
            for (index, frame) in file["frames"].as_array_mut().expect("a list").iter_mut().enumerate() {
                frame["mask_path"] = json!(format!("m/{index}.png"));
                let mask = image::GrayImage::from_pixel(64, 64, image::Luma([grey]));
                mask.save(folder.join(format!("{index}.png"))).expect("writable");
            }
        });
    }
}

#[test]
fn masks_that_leave_nothing_to_train_on_are_an_error() {
    let toys = Toys::new();
    toys.add_masks(0);
    toys.info().expect(1, "error", &["every pixel of all", "training photos", "--invert-masks"], &[]);
    assert_eq!(info(&toys.path(), &["--invert-masks"]).of_severity("error"), [""; 0]);
}

#[test]
fn every_damaged_file_is_told() {
    let toys = Toys::new();
    toys.add_masks(255);
    for file in [toys.photo(3), toys.photo(7), toys.path().join("m/5.png")] {
        fs::write(file, "").expect("writable");
    }
    fs::remove_file(toys.photo(9)).expect("there");
    // The first sample of the alpha, and of the surroundings.
    let whole = fs::read(toys.photo(0)).expect("readable");
    fs::write(toys.photo(0), &whole[..whole.len() / 2]).expect("writable");
    let result = toys.info();
    result.expect(
        1,
        "error",
        &["2 of 24 photos cannot be read (./train/0003, ./train/0007): each is an empty file"],
        &[],
    );
    for name in ["0000.png", "m/5.png"] {
        result.expect(1, "error", &[name], &[]);
    }
    result.expect(1, "warning", &["1 of 24 listed images", "0009"], &[]);
    assert_eq!([&result.json["frames"], &result.json["found"]], [24, 21]);
    assert_eq!(result.json["missing"], json!(["./train/0003", "./train/0007", "./train/0009"]));
    for split in ["train", "val", "test"] {
        for entry in fs::read_dir(toys.path().join(split)).expect("readable") {
            fs::write(entry.expect("readable").path(), "").expect("there");
        }
    }
    let result = toys.info();
    result.expect(1, "error", &["23 of 24 photos cannot be read", "each is an empty file"], &[]);
    assert_eq!([&result.json["frames"], &result.json["found"]], [24, 0]);
    assert!(!result.stderr.contains("put the images"), "{}", result.stderr);
}

#[test]
fn masks_that_belong_to_no_photo_are_told() {
    let toys = Toys::new();
    info(&toys.path(), &["--invert-masks"]).expect(
        0,
        "warning",
        &["no frame has one", "--invert-masks"],
        &[],
    );
    let masks = toys.path().join("masks");
    fs::create_dir(&masks).expect("writable");
    toys.info().expect_no_alarm();
    let mut mask = image::GrayImage::from_pixel(64, 64, image::Luma([255]));
    mask.put_pixel(0, 0, image::Luma([0]));
    for name in ["mask_0000.png", "mask_0001.png"] {
        mask.save(masks.join(name)).expect("writable");
    }
    let parts = ["no mask in", "found mask_0000.png, expected 0000.png for 0000.png", "name each mask"];
    toys.info().expect(0, "warning", &parts, &[]);
    mask.save(masks.join("0000.png")).expect("writable");
    let result = toys.info();
    result.expect(0, "note", &["of 24 frames have no mask"], &[]);
    result.expect_no_alarm();
    assert!(info(&toys.path(), &["--invert-masks"]).of_severity("error").is_empty());
}

#[test]
fn a_single_view_to_train_on_is_told_beside_those_to_test_on() {
    let toys = Toys::new();
    let parts = ["there is a single image to train on", "add photos from other places"];
    info(&toys.path(), &["--max-images", "1"]).expect(0, "warning", &parts, &[]);
    assert!(info(&toys.path(), &["--max-images", "2"]).of_severity("warning").is_empty());
}

#[test]
fn a_map_that_cannot_be_written_leaves_the_report() {
    let toys = Toys::new();
    let map = toys.folder.path().join("nowhere/map.svg");
    let result = info(&toys.path(), &["--plot", &map.to_string_lossy()]);
    assert_eq!((result.code, &result.json["ok"]), (1, &json!(true)));
    assert!(result.stderr.contains("map.svg: the folder"), "{}", result.stderr);
    assert!(!result.stderr.contains(".part"), "{}", result.stderr);
}
