//! Folders of rendered frames, and of test views saved as pictures: nothing is mixed, and nothing is replaced unasked.

use crate::program::{generated, nerf, object, place, quietly, text, train};
use nerf::capture::image_file::read_exr_channel;
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

static TOYS: LazyLock<PathBuf> =
    LazyLock::new(|| generated("toys", "toys", &["--views", "11", "--size", "16"]));
static FIELD: LazyLock<PathBuf> = LazyLock::new(|| trained("20"));

fn trained(steps: &str) -> PathBuf {
    let run = place("run");
    train(&TOYS, &run, &["--steps", steps, "--no-eval"]);
    run
}

fn render<'a>(run: &'a Path, out: &'a Path, further: &[&'a str]) -> Vec<&'a str> {
    let args = ["render", text(run), "--out", text(out)];
    let width: &[&str] = if further.contains(&"--width") { &[] } else { &["--width", "8"] };
    [&args[..], further, width].concat()
}

/// The indices of the listed frames, whose files are all there and no others.
fn listed(out: &Path) -> Vec<u64> {
    let listing = fs::read_to_string(out.join("frames.json")).expect("a listing");
    let listing: Value = serde_json::from_str(&listing).expect("JSON");
    let frames = listing["frames"].as_array().expect("frames");
    let mut files: Vec<_> =
        frames.iter().map(|frame| frame["files"]["png"].as_str().expect("a name").to_owned()).collect();
    files.push("frames.json".to_owned());
    let mut there: Vec<_> = fs::read_dir(out)
        .expect("a folder")
        .map(|entry| entry.expect("readable").file_name().into_string().expect("UTF-8"))
        .collect();
    there.sort();
    assert_eq!(there, files, "nothing is left behind");
    frames.iter().map(|frame| frame["index"].as_u64().expect("a number")).collect()
}

/// A channel of the first frame of an orbit, with the flags `further`; rows of it.
fn orbit_channel(name: &str, further: &[&str]) -> Vec<Vec<f32>> {
    let out = place("framed");
    let orbit = ["--orbit", "1", "--format", "exr"];
    object(&render(&FIELD, &out, &[&orbit[..], further].concat()));
    let (width, _, values) = read_exr_channel(&out.join("0000.exr"), name).expect("the channel");
    values.chunks(width as usize).map(<[f32]>::to_vec).collect()
}

#[test]
fn views_of_another_aspect_are_wider_and_not_stretched() {
    let square = orbit_channel("R", &["--width", "16", "--spp", "1"]);
    let wide = orbit_channel("R", &["--width", "32", "--height", "16", "--spp", "1"]);
    assert_eq!((wide.len(), wide[0].len()), (16, 32));
    let middle: Vec<&[f32]> = wide.iter().map(|row| &row[8..24]).collect();
    let difference = square.iter().zip(middle).flat_map(|(row, other)| row.iter().zip(other));
    let largest = difference.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(largest < 0.01, "{largest}");
    let coarse = orbit_channel("A", &["--width", "4", "--spp", "1"]);
    let automatic = orbit_channel("A", &["--width", "4"]);
    assert_ne!(coarse, automatic, "16 samples");
    assert_eq!(automatic, orbit_channel("A", &["--width", "4", "--spp", "16"]));
    let (depth, far) = (
        orbit_channel("Z", &["--width", "16", "--fov", "120"]),
        orbit_channel("Z", &["--width", "16", "--fov", "120", "--far-depth", "100"]),
    );
    let pairs: Vec<_> = depth.iter().flatten().zip(far.iter().flatten()).collect();
    assert!(pairs.iter().any(|(z, _)| **z == 0.0));
    assert!(pairs.iter().all(|&(&z, &far)| far == if z == 0.0 { 100.0 } else { z }));
}

#[test]
fn a_path_is_rendered_in_parts_and_by_several_processes() {
    let out = place("views");
    let orbit = ["--orbit", "12", "--frames", "0..3"];
    object(&render(&FIELD, &out, &orbit));
    assert_eq!(listed(&out), [0, 1, 2]);
    quietly(&render(&FIELD, &out, &orbit)).assert().code(1).stderr(contains("add --skip-existing"));
    let parts = ["2..7", "5..9", "9..12"].map(|range| {
        let part = ["--orbit", "12", "--frames", range, "--skip-existing"];
        let mut command = Command::new(nerf().get_program());
        command.args(render(&FIELD, &out, &part)).arg("--quiet").spawn().expect("starts")
    });
    for mut part in parts {
        assert!(part.wait().expect("ends").success());
    }
    assert_eq!(listed(&out), (0..12).collect::<Vec<_>>());
    let whole = fs::read(out.join("0004.png")).expect("a frame");
    fs::write(out.join("0004.png"), &whole[..whole.len() / 2]).expect("writable");
    fs::write(out.join(".nerf-a1b2c3.part"), "half of a frame").expect("writable");
    let rest = object(&render(&FIELD, &out, &["--orbit", "12", "--skip-existing"]));
    assert_eq!((rest["frames"].as_u64(), rest["skipped"].as_u64()), (Some(1), Some(11)));
    assert_eq!(fs::read(out.join("0004.png")).expect("a frame"), whole);
    listed(&out);
}

#[test]
fn frames_of_two_renderings_do_not_mix() {
    let (out, other) = (place("views"), trained("21"));
    object(&render(&FIELD, &out, &["--orbit", "4"]));
    for (run, further, why) in [
        (&other, ["--orbit", "4", "--width", "8"], "another field"),
        (&*FIELD, ["--orbit", "4", "--width", "9"], "other cameras or sizes"),
        (&*FIELD, ["--orbit", "5", "--width", "8"], "other cameras or sizes"),
    ] {
        let args = render(run, &out, &further);
        quietly(&args).arg("--skip-existing").assert().code(1).stderr(contains(why));
        assert_eq!(listed(&out), [0, 1, 2, 3]);
    }
    let white = ["--orbit", "4", "--background", "white", "--skip-existing"];
    quietly(&render(&FIELD, &out, &white)).assert().code(1).stderr(contains("background was"));
    object(&render(&other, &out, &["--orbit", "2", "--overwrite"]));
    assert_eq!(listed(&out), [0, 1], "no frame of the other field is left");
}

#[test]
fn test_views_of_two_fields_do_not_mix() {
    let (out, other) = (place("views"), trained("22"));
    let saved = |run: &Path, further: &[&str]| {
        let args = ["eval", text(run), text(&TOYS), "--save", text(&out)];
        quietly(&[&args, further].concat()).assert()
    };
    saved(&FIELD, &[]).success();
    saved(&FIELD, &["--split", "val"]).success();
    let pictures = |split: &str| {
        let entries = fs::read_dir(&out).expect("a folder").map(|entry| entry.expect("readable").file_name());
        entries.filter(|name| text(Path::new(name)).starts_with(split)).count()
    };
    assert!(pictures("test_") > 0 && pictures("val_") > 0, "other views of the same field come beside them");
    saved(&other, &[]).code(1).stderr(contains("another field").and(contains("--overwrite")));
    saved(&FIELD, &["--downscale", "2"]).code(1).stderr(contains("photos read otherwise"));
    saved(&FIELD, &["--background", "white"]).code(1).stderr(contains("another background"));
    saved(&other, &["--overwrite"]).success();
    assert_eq!(pictures("val_"), 0, "no rendering of the other field is left");
    fs::remove_file(out.join("renderings.json")).expect("removable");
    saved(&other, &[]).code(1).stderr(contains("test_0000.png would be replaced"));
    quietly(&["eval", text(&FIELD), text(&TOYS), "--overwrite"]).assert().code(2);
}

#[test]
fn photos_are_never_replaced() {
    let photo = fs::read(TOYS.join("test/0000.png")).expect("a photo");
    let cameras = TOYS.join("transforms_test.json");
    let out = TOYS.join("train/../test");
    let among = render(&FIELD, &out, &["--cameras", text(&cameras), "--overwrite"]);
    quietly(&among).assert().code(1).stderr(contains("holds photos"));
    let eval = |out: &Path| ["eval", text(&FIELD), text(&TOYS), "--save", text(out)].map(str::to_owned);
    let saved = |out: &Path| quietly(&eval(out).each_ref().map(String::as_str));
    for folder in [&out, &*TOYS] {
        saved(folder).assert().code(1).stderr(contains("holds files of the dataset"));
    }
    let views = place("saved");
    saved(&views).assert().success();
    assert!(views.join("test_0000.png").exists(), "the name tells the photo");
    #[cfg(unix)]
    {
        fs::remove_file(views.join("test_0000.png")).expect("removable");
        std::os::unix::fs::symlink(TOYS.join("test/0000.png"), views.join("test_0000.png")).expect("a link");
        saved(&views).assert().code(1).stderr(contains("leads to a file of the dataset"));
        let linked = place("linked");
        std::os::unix::fs::symlink(TOYS.join("test"), &linked).expect("a link");
        saved(&linked).assert().code(1).stderr(contains("holds files of the dataset"));
    }
    assert_eq!(fs::read(TOYS.join("test/0000.png")).expect("a photo"), photo);
}
