//! Checkpoints as files: those that are damaged, those before them, and the datasets that they belong to.

use crate::program::{SMOKE, checkpoint, generated, nerf, object, place, quietly, text, train};
use predicates::prelude::*;
use predicates::str::contains;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

static TOYS: LazyLock<PathBuf> =
    LazyLock::new(|| generated("toys", "few_toys", &["--views", "6", "--size", "16", "--samples", "1"]));

/// The checkpoints in a run's folder, by name.
fn checkpoints(run: &Path) -> Vec<String> {
    let entries = fs::read_dir(run).expect("a folder").map(|entry| entry.expect("an entry").file_name());
    let mut names: Vec<_> = entries.map(|name| name.to_string_lossy().into_owned()).collect();
    names.retain(|name| name.contains("checkpoint") || name.starts_with('.'));
    names.sort();
    names
}

#[test]
fn the_checkpoint_before_is_kept_and_used_where_the_newest_is_damaged() {
    let run = place("kept");
    for (steps, further) in [("32", ["--keep", "2"].as_slice()), ("48", &["--resume"])] {
        train(&TOYS, &run, &[&["--no-eval", "--steps", steps], further].concat());
    }
    let newest = run.join("checkpoint.safetensors");
    assert_eq!(checkpoints(&run), ["checkpoint-32.safetensors", "checkpoint.safetensors"]);
    let mut bytes = fs::read(&newest).expect("a checkpoint");
    let middle = bytes.len() / 2;
    bytes[middle..middle + 4096].fill(0);
    fs::write(&newest, &bytes).expect("writable");
    let says = || contains("is damaged").and(contains("checkpoint-32.safetensors of step 32"));
    let out = place("views");
    let commands = [
        &["render", text(&run), "--orbit", "1", "--width", "8", "--out", text(&out)][..],
        &["eval", text(&run), text(&TOYS)],
        &["report", text(&run)],
    ];
    for args in commands {
        let mut command = nerf();
        command.args(args).assert().success().stderr(says().and(contains("the tensor '")));
    }
    quietly(&["eval", text(&newest), text(&TOYS)]).assert().code(1).stderr(contains("is damaged"));
    let args = ["train", text(&TOYS), "--out", text(&run), "--resume", "--steps", "64", "--no-eval"];
    let mut command = nerf();
    command.args(args).args(["--keep", "3"]).assert().success().stderr(says());
    // What is damaged is not kept.
    assert_eq!(checkpoints(&run), ["checkpoint-32.safetensors", "checkpoint.safetensors"]);
    assert_eq!(checkpoint(&run).state.step, 64);
    let before = fs::read(&newest).expect("a checkpoint");
    let result = object(&args);
    assert_eq!((result["steps"].as_u64(), fs::read(&newest).expect("there") == before), (Some(64), true));
    let more = ["--steps", "96", "--checkpoint-every", "0", "--keep", "3"];
    quietly(&["train", text(&TOYS), "--out", text(&run), "--resume", "--no-eval"])
        .args(more)
        .assert()
        .success();
    let kept = checkpoints(&run);
    assert!(kept.len() == 3 && !kept.contains(&"checkpoint-32.safetensors".to_owned()), "{kept:?}");
    quietly(&["train", text(&TOYS), "--out", text(&run), "--overwrite", "--steps", "8", "--config", SMOKE])
        .assert()
        .success();
    assert_eq!(checkpoints(&run), ["checkpoint.safetensors"]);
}

/// A copy of a dataset whose training file was changed.
fn changed(dataset: &Path, name: &str, change: impl Fn(&mut Value)) -> PathBuf {
    let copy = place(name);
    copy_folder(dataset, &copy);
    let listing = copy.join("transforms_train.json");
    let mut value: Value = serde_json::from_slice(&fs::read(&listing).expect("readable")).expect("JSON");
    change(&mut value);
    fs::write(listing, serde_json::to_vec_pretty(&value).expect("JSON")).expect("writable");
    copy
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("writable");
    for entry in fs::read_dir(from).expect("a folder").map(|entry| entry.expect("an entry")) {
        let (from, to) = (entry.path(), to.join(entry.file_name()));
        if from.is_dir() {
            copy_folder(&from, &to);
        } else {
            fs::copy(from, to).expect("writable");
        }
    }
}

fn inverted(photo: &Path) {
    let mut picture = image::open(photo).expect("a photo");
    picture.invert();
    picture.save(photo).expect("writable");
}

/// Turns all poses about the vertical by a right angle: nothing about names, sizes and distances changes.
fn turned(listing: &mut Value) {
    for frame in listing["frames"].as_array_mut().expect("frames") {
        let rows = frame["transform_matrix"].as_array_mut().expect("a matrix");
        rows.swap(0, 1);
        let negative = |value: &Value| Value::from(-value.as_f64().expect("a number"));
        rows[0] = rows[0].as_array().expect("a row").iter().map(negative).collect();
    }
}

#[test]
fn a_run_knows_its_dataset_by_content() {
    let run = place("known");
    train(&TOYS, &run, &["--no-eval", "--steps", "8"]);
    let resume = |dataset: &Path, steps: &str| {
        let mut command = nerf();
        command.args([
            "train",
            text(dataset),
            "--out",
            text(&run),
            "--resume",
            "--no-eval",
            "--steps",
            steps,
        ]);
        command.assert()
    };
    let eval = |dataset: &Path| {
        nerf().args(["eval", text(&run), text(dataset), "--split", "train"]).assert().success()
    };
    let poses = changed(&TOYS, "turned", turned);
    let says = contains("the cameras of 4 of 4 frames").and(contains("turned by 90"));
    eval(&poses).stderr(says.and(contains("another dataset")));
    // The test view has its camera still, and all photos are the same.
    let says =
        contains("the cameras of 4 of 5 frames").and(contains("turned by 90")).and(contains("photos").not());
    resume(&poses, "16").code(1).stderr(says.and(contains("--overwrite")).and(contains(text(&TOYS))));
    let photos = changed(&TOYS, "inverted", |_| {});
    inverted(&photos.join("train/0001.png"));
    let says = contains("the photos of 1 of 5 frames (./train/0001) are not those of the run");
    resume(&photos, "16").code(1).stderr(says.and(contains("cameras").not()));
    eval(&photos).stderr(contains("the photos of 1 of 4 frames"));
    let zoomed = changed(&TOYS, "zoomed", |listing| listing["camera_angle_x"] = 0.5.into());
    resume(&zoomed, "16").code(1).stderr(contains("another focal length or lens"));
    // Another name, another text and fewer digits are the same dataset.
    let moved = changed(&TOYS, "moved", |listing| {
        for frame in listing["frames"].as_array_mut().expect("frames") {
            for row in frame["transform_matrix"].as_array_mut().expect("a matrix") {
                for value in row.as_array_mut().expect("a row") {
                    *value = ((value.as_f64().expect("a number") * 1e7).round() / 1e7).into();
                }
            }
        }
    });
    let silent = || contains("note:").or(contains("warning:")).not();
    resume(&moved, "16").success().stderr(silent());
    eval(&moved).stderr(silent());
    let metadata = checkpoint(&run).metadata;
    assert_eq!((metadata.dataset.as_str(), metadata.step), (text(&TOYS), 16), "the name stays");
    resume(&moved, "16").success().stdout(contains("no step was taken").and(contains("--steps")));
    // A run from before its contents were kept is compared as far as it goes.
    let mut before = checkpoint(&run);
    before.metadata.contents = None;
    before.save(&run.join("checkpoint.safetensors")).expect("writable");
    resume(&photos, "24").success().stderr(contains("note: the checkpoint is from before").count(1));
    assert!(checkpoint(&run).metadata.contents.is_some(), "from now on");
}

#[test]
fn what_a_resumed_run_ignores_is_said() {
    let (dataset, run) = (changed(&TOYS, "one_list", |_| {}), place("ignoring"));
    fs::rename(dataset.join("transforms_train.json"), dataset.join("transforms.json")).expect("renamed");
    for split in ["val", "test"] {
        fs::remove_file(dataset.join(format!("transforms_{split}.json"))).expect("there");
    }
    train(&dataset, &run, &["--no-eval", "--steps", "8", "--hold-out", "2"]);
    let resume = |further: &[&str]| {
        let args = ["train", text(&dataset), "--out", text(&run), "--resume", "--no-eval"];
        nerf().args(args).args(further).assert().success()
    };
    let ignored = || contains("--hold-out has no effect").or(contains("config.json is not read"));
    resume(&["--steps", "16", "--hold-out", "2", "--set", "loss.sparsity=0.001"]).stderr(ignored().not());
    resume(&["--steps", "24", "--hold-out", "none"]).stderr(contains("--hold-out has no effect on --resume"));
    let config = run.join("config.json");
    let edited = fs::read_to_string(&config).expect("readable").replace("\"seed\": 0", "\"seed\": 7");
    fs::write(&config, &edited).expect("writable");
    resume(&["--steps", "32"])
        .stderr(contains("config.json is not read").and(contains("seed is 7 there and 0")));
    fs::write(&config, &edited).expect("writable");
    resume(&["--steps", "40", "--config", text(&config)]).stderr(ignored().not());
    assert_eq!(checkpoint(&run).metadata.config.seed, 7);
    assert_eq!(checkpoint(&run).metadata.splits.test.len(), 2);
}

#[test]
fn a_diverging_training_stops_and_keeps_the_good_checkpoint() {
    let run = place("diverging");
    train(&TOYS, &run, &["--no-eval", "--steps", "16"]);
    let mut diverging = checkpoint(&run);
    diverging.state.floats_mut("mlp").iter_mut().for_each(|weight| *weight *= 1e30);
    let file = run.join("checkpoint.safetensors");
    diverging.save(&file).expect("writable");
    let before = fs::read(&file).expect("a checkpoint");
    quietly(&["train", text(&TOYS), "--out", text(&run), "--resume", "--steps", "64"])
        .assert()
        .code(1)
        .stderr(contains("not finite").and(contains("learning_rate")).and(contains("step 16 is kept")));
    assert_eq!(fs::read(&file).expect("still there"), before);
}
