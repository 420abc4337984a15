//! Depth: a few views see where the surfaces are.

use super::{SIZE, TOYS, channel, copy, edit_frames, rendered};
use crate::program::{SMOKE, number, place, quietly, text, train};
use image::{ImageBuffer, Luma};
use predicates::str::contains;
use serde_json::json;
use std::path::Path;

/// So few photos that colours alone do not tell the shape.
const FEW: [&str; 4] = ["--max-images", "6", "--steps", "300"];

/// Trains with this weight of the depth: the mean absolute error of the test views' depth, and their PSNR.
fn errors(dataset: &Path, name: &str, weight: &str) -> (f64, f64) {
    let run = place(name);
    let set = format!("loss.depth={weight}");
    let psnr = number(&train(dataset, &run, &[&FEW[..], &["--set", &set]].concat())["psnr"]);
    let (mut sum, mut count) = (0.0, 0.0);
    for (view, index) in rendered(&run, dataset).iter().zip(0..) {
        let truth = TOYS.join(format!("test/{index:04}_depth.exr"));
        let [z, alpha] = ["Z", "A"].map(|name| channel(view, name));
        let [true_z, true_alpha] = ["Z", "A"].map(|name| channel(&truth, name));
        for pixel in 0..z.len() {
            if alpha[pixel] > 0.9 && true_alpha[pixel] > 0.999 {
                sum += f64::from(z[pixel] - true_z[pixel]).abs();
                count += 1.0;
            }
        }
    }
    assert!(count > 500.0, "{count} opaque pixels");
    println!("loss.depth = {weight}: mean error {:.4}, {psnr:.2} dB, {count} pixels", sum / count);
    (sum / count, psnr)
}

#[test]
fn depth_puts_surfaces_where_they_are() {
    let (without, _) = errors(&TOYS, "depth_0", "0");
    let (with, _) = errors(&TOYS, "depth_1", "1");
    assert!(with < 0.6 * without, "{without} {with}");

    let millimetres = copy(&TOYS, "millimetres");
    for index in 0..33 {
        let z = channel(&millimetres.join(format!("train/{index:04}_depth.exr")), "Z");
        let steps = z.iter().map(|z| (z * 1000.0).round() as u16).collect();
        let picture = ImageBuffer::<Luma<u16>, Vec<u16>>::from_raw(SIZE, SIZE, steps).expect("all pixels");
        picture.save(millimetres.join(format!("train/{index:04}_mm.png"))).expect("writable");
    }
    edit_frames(&millimetres, |name| vec![("depth_file_path", json!(format!("{name}_mm.png")))]);
    let (of_png, _) = errors(&millimetres, "depth_png", "1");
    assert!((of_png - with).abs() < 0.2 * with, "{with} {of_png}");
}

#[test]
fn depth_that_is_not_there_is_refused() {
    let dataset = copy(&TOYS, "flat");
    edit_frames(&dataset, |_| vec![("depth_file_path", json!(null))]);
    let run = place("flat_run");
    let args = ["train", text(&dataset), "--out", text(&run), "--config", SMOKE, "--set", "loss.depth=1"];
    quietly(&args).assert().code(1).stderr(contains("no training frame has a depth file"));
    assert!(!run.exists(), "nothing was begun");
}
