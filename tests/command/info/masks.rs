//! What `nerf info` says of masks.

use super::toys::{Toys, info};
use crate::program::nerf;
use image::{GrayAlphaImage, GrayImage, Luma, LumaA};
use predicates::str::contains;
use serde_json::{Value, json};
use std::fs;

const SIZE: u32 = 64;

/// Toys with a mask for every photo, grey and alpha by column and row.
fn masked(pixel: impl Fn(u32, u32) -> [u8; 2]) -> Toys {
    let toys = Toys::new();
    for split in ["train", "val", "test"] {
        fs::create_dir_all(toys.path().join("masks").join(split)).expect("writable");
        toys.edit(split, |file| {
            for frame in file["frames"].as_array().expect("a list") {
                let name = frame["file_path"].as_str().expect("a name").trim_start_matches("./");
                let mask = GrayAlphaImage::from_fn(SIZE, SIZE, |x, y| LumaA(pixel(x, y)));
                mask.save(toys.path().join(format!("masks/{name}.png"))).expect("writable");
            }
        });
    }
    toys
}

fn part(json: &Value) -> f64 {
    json["photos"]["ignored_by_masks"].as_f64().expect("a part")
}

/// Whether a pixel is in the middle half of both sides.
fn is_inside(x: u32, y: u32) -> bool {
    (SIZE / 4..3 * SIZE / 4).contains(&x) && (SIZE / 4..3 * SIZE / 4).contains(&y)
}

#[test]
fn the_part_that_masks_ignore_is_told() {
    let toys = masked(|x, y| [u8::from(is_inside(x, y)), 255]);
    let result = toys.info();
    result.expect_no_alarm();
    assert_eq!(part(&result.json), 0.75, "ones are white");
    assert_eq!(result.json["photos"]["ignored_of_masked"]["min"], 0.75);
    let text = nerf().arg("info").arg(toys.path()).assert().success();
    text.stdout(contains("masks     ignore 75 % of all pixels; 75 % of a photo with a mask"));
    // One photo without a mask, and one whose mask ignores all.
    fs::remove_file(toys.path().join("masks/train/0003.png")).expect("removed");
    GrayImage::new(SIZE, SIZE).save(toys.path().join("masks/train/0004.png")).expect("writable");
    assert!((part(&toys.info().json) - (22.0 * 0.75 + 1.0) / 24.0).abs() < 1e-9);
    assert_eq!(Toys::new().info().json["photos"]["ignored_by_masks"], 0.0);
}

#[test]
fn masks_in_alpha_are_read() {
    let toys = masked(|x, y| [0, if is_inside(x, y) { 255 } else { 0 }]);
    // Where all of a photo counts, its mask alone does not tell.
    let whole = GrayAlphaImage::from_pixel(SIZE, SIZE, LumaA([0, 255]));
    whole.save(toys.path().join("masks/train/0000.png")).expect("writable");
    let result = toys.info();
    result.expect_no_alarm();
    result.expect(0, "note", &["masks are in the alpha channel"], &[]);
    assert!((part(&result.json) - 23.0 * 0.75 / 24.0).abs() < 1e-9);
}

#[test]
fn masks_that_can_hardly_be_meant_are_remarked_on() {
    let white = masked(|_, _| [255, 255]);
    white.info().expect(0, "warning", &["the masks of 24 photos ignore nothing", "must be black"], &[]);
    let inverting = info(&white.path(), &["--invert-masks"]);
    inverting.expect(1, "error", &["all 20 training photos", "leave out --invert-masks"], &[]);
    assert_eq!(inverting.of_severity("warning"), [""; 0], "said once");

    let inverted = masked(|x, y| [if is_inside(x, y) { 0 } else { 255 }, 255]);
    let parts = ["ignore 100 % of the middle", "if that is what the photos were taken of", "--invert-masks"];
    inverted.info().expect(0, "warning", &parts, &[]);
    info(&inverted.path(), &["--invert-masks"]).expect_no_alarm();

    // Whatever is hidden at the border is no reason.
    let top = masked(|_, y| [if y < SIZE / 3 { 0 } else { 255 }, 255]);
    top.info().expect_no_alarm();

    let dynamic = Toys::new();
    for index in 0..4 {
        let path = dynamic.path().join(format!("train/dynamic_mask_{index:04}.png"));
        GrayImage::from_pixel(SIZE, SIZE, Luma([0])).save(path).expect("writable");
    }
    let result = dynamic.info();
    result.expect(0, "warning", &["the masks of 4 photos ignore nothing", "must not be black"], &[]);
    assert_eq!(result.json["images"]["with_mask"], json!(4));
}
