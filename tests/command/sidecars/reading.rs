//! How photos were read is kept, and odd lenses are rendered as they see.

use super::{SIZE, SMALL, TOYS, images, srgb8};
use crate::program::{checkpoint, generated, number, object, place, quietly, text, train};
use nerf::photo::Image;
use nerf::support::metrics::psnr;
use std::fs;

#[test]
fn photos_are_measured_as_they_were_trained_on() {
    let run = place("small_run");
    train(&TOYS, &run, &["--steps", "40", "--no-eval", "--downscale", "2", "--crop", "4"]);
    let small = SIZE / 2 - 4;
    assert_eq!(checkpoint(&run).metadata.image_size, [small; 2]);
    let measured = |further: &[&str]| {
        let out = place("small_views");
        let args = ["eval", text(&run), text(&TOYS), "--save", text(&out)];
        let psnr = number(&object(&[&args, further].concat())["psnr"]);
        (Image::load(&out.join("test_0000.png")).expect("a view").size(), psnr)
    };
    let (size, before) = measured(&[]);
    assert_eq!(size, [small; 2]);
    assert_eq!(measured(&["--downscale", "1", "--crop", "0"]).0, [SIZE; 2]);

    // As small as before, or it would be refused.
    train(&TOYS, &run, &["--resume", "--steps", "200", "--no-eval"]);
    let metadata = checkpoint(&run).metadata;
    assert_eq!((metadata.step, metadata.image_size, metadata.reading.downscale), (200, [small; 2], 2));
    let (size, after) = measured(&[]);
    assert!(size == [small; 2] && after > before + 1.0, "{before} {after}");
    let other = ["train", text(&TOYS), "--out", text(&run), "--resume", "--downscale", "1"];
    let stderr = quietly(&other).assert().code(1).get_output().stderr.clone();
    let message = String::from_utf8_lossy(&stderr).into_owned();
    assert!(message.contains("began with --downscale 2, and now it is 1"), "{message}");
    let huge = place("huge.json");
    let pose = "[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]";
    let frame = format!("{{\"file_path\": \"a.png\", \"transform_matrix\": {pose}}}");
    let file = format!("{{\"camera_angle_x\": 1, \"w\": 60000, \"h\": 60000, \"frames\": [{frame}]}}");
    fs::write(&huge, file).expect("writable");
    let views = place("huge_views");
    let render = ["render", text(&run), "--out", text(&views), "--cameras", text(&huge)];
    quietly(&render)
        .assert()
        .code(1)
        .stderr(predicates::str::contains("60000x60000 pixels, and at most 16384"));
}

/// Pixels of a picture, 0 to 1.
fn colors(pixels: &[[u8; 4]]) -> Vec<[f32; 3]> {
    // Over black.
    let over = |&[r, g, b, alpha]: &[u8; 4]| {
        [r, g, b].map(|value| f32::from(value) / 255.0 * f32::from(alpha) / 255.0)
    };
    pixels.iter().map(over).collect()
}

#[test]
fn a_fisheye_sees_what_its_photos_show() {
    let dataset = generated("toys", "fisheye", &[&SMALL[..], &["--lens", "fisheye"]].concat());
    let (run, out) = (place("fisheye_run"), place("fisheye_views"));
    let eval = number(&train(&dataset, &run, &["--steps", "300"])["psnr"]);
    let cameras = dataset.join("transforms_test.json");
    let args = ["render", text(&run), "--out", text(&out), "--cameras", text(&cameras)];
    quietly(&[&args[..], &["--background", "black"]].concat()).assert().success();
    let views = images(&out, "png");
    let photos = images(&dataset.join("test"), "png");
    assert_eq!(views.len(), photos.len());
    let pairs = views.iter().zip(&photos);
    let scores: Vec<f64> =
        pairs.map(|(view, photo)| psnr(&colors(&srgb8(view)), &colors(&srgb8(photo)))).collect();
    let mean = scores.iter().sum::<f64>() / scores.len() as f64;
    println!("{eval:.2} {mean:.2} {scores:?}");
    assert!(scores.iter().all(|&score| score > 20.0) && (mean - eval).abs() < 0.2, "{eval} {scores:?}");
    assert!(fs::metadata(out.join("frames.json")).is_ok());
}
