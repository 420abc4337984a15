//! Masks: what they ignore is not learnt.

use super::{DECIDED, Random, SIZE, TOYS, are_equal, copy, edit_frames, images, remarks, repaint, stem};
use crate::program::{number, object, place, text, train};
use image::{GrayImage, Luma};
use serde_json::json;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Sides of the patches that are painted over photos, in pixels.
const PATCH: u32 = 20;

/// Toys with a patch in another place and of another colour on every photo to train on; every third patch is a
/// hole in the middle instead, which would carve the toys away.
static PATCHED: LazyLock<PathBuf> = LazyLock::new(|| {
    let dataset = copy(&TOYS, "patched");
    for (photo, corner, color) in patches(&dataset) {
        repaint(&photo, |pixels| {
            for (index, pixel) in pixels.iter_mut().enumerate() {
                if is_within(corner, index as u32 % SIZE, index as u32 / SIZE) {
                    *pixel = color;
                }
            }
        });
    }
    dataset
});

/// Each photo to train on, with the corner and the colour of its patch.
fn patches(dataset: &Path) -> Vec<(PathBuf, [u32; 2], [u8; 4])> {
    let mut random = Random(7);
    let patch = |(number, photo): (usize, PathBuf)| {
        let color = [0; 3].map(|_: u8| random.below(256) as u8);
        let corner = [0; 2].map(|_: u32| random.below(SIZE - PATCH));
        match number % 3 {
            0 => (photo, [(SIZE - PATCH) / 2; 2], [0; 4]),
            _ => (photo, corner, [color[0], color[1], color[2], 255]),
        }
    };
    images(&dataset.join("train"), "png").into_iter().enumerate().map(patch).collect()
}

fn is_within([left, top]: [u32; 2], x: u32, y: u32) -> bool {
    (left..left + PATCH).contains(&x) && (top..top + PATCH).contains(&y)
}

/// Writes a mask of every patch to where `name` says, `inside` the patch and `outside` of it.
fn write_masks(dataset: &Path, name: impl Fn(&str) -> String, inside: u8, outside: u8) {
    for (photo, corner, _) in patches(dataset) {
        let path = dataset.join(name(stem(&photo)));
        fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
        let value = |x, y| Luma([if is_within(corner, x, y) { inside } else { outside }]);
        GrayImage::from_fn(SIZE, SIZE, value).save(path).expect("writable");
    }
}

/// Patched toys whose frames name their masks.
fn with_mask_paths(name: &str, inside: u8, outside: u8) -> PathBuf {
    let dataset = copy(&PATCHED, name);
    write_masks(&dataset, |stem| format!("ignore/{stem}.png"), inside, outside);
    edit_frames(&dataset, |name| match name.strip_prefix("./train/") {
        Some(stem) => vec![("mask_path", json!(format!("ignore/{stem}.png")))],
        None => Vec::new(),
    });
    dataset
}

#[test]
fn what_masks_ignore_is_not_learnt() {
    let masked = with_mask_paths("mask_path", 0, 255);
    let steps = ["--deterministic", "--steps", "300"];
    let [bare, with_masks] = [("bare", &*PATCHED), ("masked", &masked)]
        .map(|(name, dataset)| number(&train(dataset, &place(&format!("{name}_run")), &steps)["psnr"]));
    println!("{bare:.2} dB without masks, {with_masks:.2} dB with them");
    assert!(with_masks > bare + 4.0, "{bare} {with_masks}");
}

#[test]
fn masks_are_found_wherever_tools_put_them() {
    let run = |name: &str, dataset: &Path, further: &[&str]| {
        let run = place(&format!("{name}_short"));
        train(dataset, &run, &[&DECIDED[..], further].concat());
        run
    };
    let named = run("named", &with_mask_paths("named", 0, 255), &[]);
    let inverted = run("inverted", &with_mask_paths("inverted", 255, 0), &["--invert-masks"]);
    assert!(are_equal(&named, &inverted), "--invert-masks and inverted masks");

    let beside = copy(&PATCHED, "beside");
    write_masks(&beside, |stem| format!("masks/{stem}.png"), 0, 255);
    assert!(are_equal(&named, &run("beside", &beside, &[])), "masks in a folder");

    let dynamic = copy(&PATCHED, "dynamic");
    write_masks(&dynamic, |stem| format!("train/dynamic_mask_{stem}.png"), 1, 0);
    let of_dynamic = run("dynamic", &dynamic, &[]);
    assert!(are_equal(&named, &of_dynamic), "dynamic masks");
    assert!(!are_equal(&named, &run("none", &PATCHED, &[])), "and masks do change something");
}

#[test]
fn masks_that_ignore_whole_photos() {
    let all = with_mask_paths("all_black", 0, 0);
    let (success, said) = remarks(&all, &place("all_black_run"), &DECIDED);
    assert!(!success && said.contains("all 33 training photos") && said.contains("--invert-masks"), "{said}");

    let one = with_mask_paths("one_black", 0, 255);
    GrayImage::new(SIZE, SIZE).save(one.join("ignore/0004.png")).expect("writable");
    let run = place("one_black_run");
    let (success, said) = remarks(&one, &run, &DECIDED);
    assert!(success, "{said}");
    let warning =
        "warning: masks ignore every pixel of 1 of 33 training photos, which add nothing: ./train/0004";
    assert!(said.contains(warning), "{said}");
}

/// A mask changes which pixels the device keeps, also from one run to the next.
#[test]
fn masks_may_come_later() {
    let (dataset, run) = (copy(&PATCHED, "later"), place("later_run"));
    let spoilt = number(&train(&dataset, &run, &["--steps", "120"])["psnr"]);
    write_masks(&dataset, |stem| format!("masks/{stem}.png"), 0, 255);
    let mended = number(&train(&dataset, &run, &["--resume", "--steps", "300"])["psnr"]);
    println!("{spoilt:.2} dB, then {mended:.2} dB");
    assert!(mended > spoilt + 3.0, "{spoilt} {mended}");
}

/// Test views are measured where their masks let them be.
#[test]
fn masked_pixels_of_test_views_are_not_measured() {
    let dataset = copy(&TOYS, "masked_test");
    let run = place("masked_test_run");
    train(&dataset, &run, &["--steps", "40", "--no-eval"]);
    let eval = || object(&["eval", text(&run), text(&dataset)]);
    let plain = number(&eval()["views"][0]["psnr"]);
    let view = dataset.join("test/0000.png");
    repaint(&view, |pixels| pixels[..(SIZE * SIZE / 2) as usize].fill([255; 4]));
    let spoilt = number(&eval()["views"][0]["psnr"]);
    fs::create_dir(dataset.join("masks")).expect("writable");
    let lower_half = |_, y| Luma([if y < SIZE / 2 { 0 } else { 255 }]);
    // Beside the images' folder, so that only the test view of this number has one.
    fs::create_dir_all(dataset.join("masks/test")).expect("writable");
    GrayImage::from_fn(SIZE, SIZE, lower_half).save(dataset.join("masks/test/0000.png")).expect("writable");
    let masked = eval();
    let measured = number(&masked["views"][0]["psnr"]);
    assert!(spoilt < plain - 3.0 && measured > spoilt + 3.0, "{plain} {spoilt} {measured}");
    assert_eq!(masked["views"][0]["ignored"], SIZE * SIZE / 2);
    assert!(masked["views"][1].get("ignored").is_none(), "{masked}");
}
