//! Training runs from end to end with everything that a photo may bring: masks, depth, alpha, 16 bits, linear light,
//! a size of its own and an odd lens.

mod alpha;
mod depth;
mod masks;
mod ranges;
mod reading;

use crate::program::{SMOKE, checkpoint, generated, nerf, number, place, quietly, text, train};
use crate::support::files;
use nerf::capture::image_file::{ExrPixels, Precision, read_exr_channel, write_exr, write_png_rgba8};
use nerf::photo::{Image, Pixels};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Width and height of the datasets here.
const SIZE: u32 = 48;
/// So many views in all splits, and that size.
const SMALL: [&str; 4] = ["--views", "40", "--size", "48"];

/// 33 views to train on and 5 to test on, with alpha and depth.
static TOYS: LazyLock<PathBuf> = LazyLock::new(|| generated("toys", "toys", &SMALL));

/// Steps after which differences show.
const STEPS: [&str; 2] = ["--steps", "300"];

/// A training run on [`TOYS`] as they are, and its PSNR.
static PLAIN: LazyLock<(PathBuf, f64)> = LazyLock::new(|| {
    let run = place("plain_run");
    let psnr = number(&train(&TOYS, &run, &STEPS)["psnr"]);
    (run, psnr)
});

/// A dataset with the same files.
fn copy(dataset: &Path, name: &str) -> PathBuf {
    let path = place(name);
    copy_folder(dataset, &path);
    path
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("writable");
    for entry in fs::read_dir(from).expect("a folder").flatten() {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy_folder(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).expect("copied");
        }
    }
}

/// Files with this extension that lie in `folder`, in order; no depth.
fn images(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut images = files(folder, extension);
    images.retain(|path| !text(path).ends_with("_depth.exr"));
    assert!(!images.is_empty(), "no {extension} in {}", folder.display());
    images
}

/// Every image of all splits.
fn all_images(dataset: &Path, extension: &str) -> Vec<PathBuf> {
    ["train", "val", "test"].iter().flat_map(|split| images(&dataset.join(split), extension)).collect()
}

fn stem(path: &Path) -> &str {
    path.file_stem().and_then(|stem| stem.to_str()).expect("a name")
}

fn srgb8(path: &Path) -> Vec<[u8; 4]> {
    let Pixels::Srgb8(pixels) = Image::load(path).expect("an image").pixels else { panic!("8 bits") };
    pixels
}

fn linear(path: &Path) -> Vec<[f32; 4]> {
    let Pixels::Linear(pixels) = Image::load(path).expect("an image").pixels else { panic!("linear") };
    pixels
}

fn write_linear(path: &Path, color: &[[f32; 4]]) {
    let pixels = ExrPixels { color, depth: None };
    write_exr(path, SIZE, SIZE, &pixels, Precision::Float).expect("writable");
}

/// Changes the pixels of an 8-bit image.
fn repaint(path: &Path, change: impl FnOnce(&mut [[u8; 4]])) {
    let mut pixels = srgb8(path);
    change(&mut pixels);
    write_png_rgba8(path, SIZE, SIZE, &pixels).expect("writable");
}

/// Gives frames of all splits further keys, or takes them away where the value is null.
fn edit_frames(dataset: &Path, keys: impl Fn(&str) -> Vec<(&'static str, Value)>) {
    for split in ["train", "val", "test"] {
        let path = dataset.join(format!("transforms_{split}.json"));
        let listing = fs::read(&path).expect("a listing");
        let mut listing: Value = serde_json::from_slice(&listing).expect("JSON");
        for frame in listing["frames"].as_array_mut().expect("frames") {
            let name = frame["file_path"].as_str().expect("a name").to_owned();
            for (key, value) in keys(&name) {
                frame[key] = value;
            }
            frame.as_object_mut().expect("an object").retain(|_, value| *value != json!(null));
        }
        fs::write(&path, listing.to_string()).expect("writable");
    }
}

/// What a training run says on stderr, and whether it succeeds.
fn remarks(dataset: &Path, run: &Path, further: &[&str]) -> (bool, String) {
    let args = ["train", text(dataset), "--out", text(run), "--config", SMOKE];
    let output = nerf().args(args).args(further).output().expect("starts");
    (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Whether two training runs have ended in the same field, bit for bit.
fn are_equal(one: &Path, other: &Path) -> bool {
    checkpoint(one).state == checkpoint(other).state
}

/// A short training run of which every bit is decided.
const DECIDED: [&str; 4] = ["--deterministic", "--no-eval", "--steps", "40"];

/// OpenEXR renderings of the test views.
fn rendered(run: &Path, dataset: &Path) -> Vec<PathBuf> {
    let out = run.with_extension("views");
    let _ = fs::remove_dir_all(&out);
    let cameras = dataset.join("transforms_test.json");
    let args = ["render", text(run), "--out", text(&out), "--cameras", text(&cameras), "--format", "exr"];
    quietly(&args).assert().success();
    images(&out, "exr")
}

fn channel(path: &Path, name: &str) -> Vec<f32> {
    read_exr_channel(path, name).expect("the channel").2
}

/// Numbers that look random; the same ones from the same `seed`.
struct Random(u64);

impl Random {
    /// A whole number below `end`.
    fn below(&mut self, end: u32) -> u32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 33) as u32) % end
    }
}
