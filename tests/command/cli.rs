//! The command line: exit codes, and one clear message for what can go wrong before training.

use crate::program::{answer, nerf};
use crate::support::folder;
use nerf::field::checkpoint::FORMAT;
use predicates::prelude::*;
use predicates::str::contains;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// A tiny dataset in `folder/toys`.
fn toys(folder: &Path) -> String {
    let toys = folder.join("toys");
    nerf()
        .args(["generate", "toys", "--views", "4", "--size", "8", "--samples", "1", "--quiet", "--out"])
        .arg(&toys)
        .assert()
        .success();
    toys.to_string_lossy().into_owned()
}

/// Runs `nerf` in `folder`, expects `code` and a message on stderr that holds all of `parts` and no panic.
fn fails(folder: &Path, args: &[&str], code: i32, parts: &[&str]) {
    let mut assert = nerf().current_dir(folder).args(args).assert().code(code);
    assert = assert.stderr(contains("panicked").not());
    for part in parts {
        assert = assert.stderr(contains(*part));
    }
}

#[test]
fn help_names_every_command_and_version_is_told() {
    let mut help = nerf().arg("--help").assert().success();
    for command in ["train", "render", "eval", "report", "info", "generate", "bench", "check", "adapters"] {
        help = help.stdout(contains(command));
        nerf().args([command, "--help"]).assert().success().stdout(contains("--adapter"));
    }
    let train = nerf().args(["train", "--help"]).assert().success();
    train.stdout(contains("--hold-out").and(contains("--resume")).and(contains("cosine")));
    nerf().arg("--version").assert().success().stdout(contains(env!("CARGO_PKG_VERSION")));
}

#[test]
fn wrong_usage_exits_with_2() {
    let here = folder();
    fails(here.path(), &[], 2, &["Usage"]);
    fails(here.path(), &["paint"], 2, &["paint"]);
    fails(here.path(), &["train", "data"], 2, &["--out"]);
    fails(here.path(), &["train", "d", "--out", "r", "--resume", "--overwrite"], 2, &["cannot be used with"]);
    fails(here.path(), &["train", "d", "--out", "r", "--background", "pink"], 2, &["pink", "0.5,0.5,0.5"]);
    fails(here.path(), &["train", "d", "--out", "r", "--seconds", "-1"], 2, &["--seconds"]);
    fails(here.path(), &["train", "d", "--out", "r", "--hold-out", "1"], 2, &["from 2 on, or none"]);
    fails(here.path(), &["train", "d", "--out", "r", "--crop", "1,2"], 2, &["left, top, right and bottom"]);
    fails(here.path(), &["eval", "r", "d", "--downscale", "0"], 2, &["--downscale"]);
    fails(here.path(), &["report", "r", "--alpha", "some"], 2, &["premultiplied"]);
    fails(here.path(), &["render", "r", "--out", "o"], 2, &["--cameras", "--orbit"]);
    fails(here.path(), &["render", "r", "--out", "o", "--orbit", "3", "--frames", "2"], 2, &["A..B"]);
    fails(here.path(), &["render", "r", "--out", "o", "--orbit", "3", "--format", "gif"], 2, &["png"]);
    fails(here.path(), &["eval", "r", "d", "--background", "grey"], 2, &["black"]);
    fails(here.path(), &["generate"], 2, &["--out"]);
    assert_eq!(fs::read_dir(here.path()).expect("readable").count(), 0, "nothing may be written");
    let said =
        nerf().args(["info", "d", "--downscale", "0", "--json"]).assert().code(2).get_output().stdout.clone();
    let said: serde_json::Value = serde_json::from_slice(&said).expect("one JSON value");
    assert!(said["error"].as_str().is_some_and(|error| error.contains("--downscale")), "{said}");
}

#[test]
fn datasets_that_cannot_be_read_are_explained() {
    let here = folder();
    let train = |dataset: &str, parts: &[&str]| {
        fails(here.path(), &["train", dataset, "--out", "run", "--steps", "1"], 1, parts);
        assert!(!here.path().join("run").exists(), "no half-written run");
    };
    train("nowhere", &["nowhere does not exist", "expected a folder"]);
    fs::create_dir(here.path().join("empty")).expect("writable");
    train("empty", &["expected transforms.json"]);
    fs::write(here.path().join("broken.json"), "{\n  \"frames\": [,]\n}").expect("writable");
    train("broken.json", &["broken.json", "line 2", "column 14"]);
    fs::write(here.path().join("none.json"), r#"{"camera_angle_x": 0.7, "frames": []}"#).expect("writable");
    train("none.json", &["none.json", "frames"]);
    let matrix = "[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]";
    let frame = format!(r#"{{"file_path": "a.png", "transform_matrix": {matrix}}}"#);
    let listing = format!(r#"{{"camera_angle_x": 0.7, "frames": [{frame}]}}"#);
    fs::write(here.path().join("missing.json"), listing).expect("writable");
    train("missing.json", &["1 of 1 listed images are missing", "a.png"]);
}

#[test]
fn settings_that_do_not_fit_are_explained() {
    let here = folder();
    let toys = toys(here.path());
    let train = |further: &[&str], parts: &[&str]| {
        let args = [&["train", &toys, "--out", "run", "--steps", "1"], further].concat();
        fails(here.path(), &args, 1, parts);
        assert!(!here.path().join("run").exists(), "no half-written run");
    };
    train(&["--set", "grid.levelz=3"], &["unknown field `levelz`", "`levels`"]);
    train(&["--set", "grid.levels=7"], &["grid.levels", "multiple of 8", "found 7"]);
    train(&["--set", "grid.levels"], &["key.path=value"]);
    train(&["--config", "nothing.json"], &["nothing.json"]);
    fs::write(here.path().join("wrong.json"), r#"{"colour": 1}"#).expect("writable");
    train(&["--config", "wrong.json"], &["wrong.json", "unknown field `colour`"]);
    train(&["--adapter", "no such adapter"], &["--adapter", "no such adapter", "there are: 0: "]);
    train(&["--adapter", "99"], &["found '99'"]);
    train(&["--resume"], &["nothing to resume"]);
    // 4 GiB of table: more than any adapter binds.
    let huge = ["grid.log2_table=24", "grid.levels=32", "grid.finest=4096"].map(|set| ["--set", set]);
    train(huge.as_flattened(), &["'table'", "use a smaller table (grid.log2_table)"]);
}

#[test]
fn folders_that_cannot_be_written_are_found_before_training() {
    let here = folder();
    let toys = toys(here.path());
    fs::write(here.path().join("file"), "in the way").expect("writable");
    let train = |out: &str, parts: &[&str]| {
        fails(here.path(), &["train", &toys, "--out", out, "--steps", "1"], 1, parts);
    };
    train("file", &["file cannot be used as a folder"]);
    train("file/run", &["file/run"]);
    train(&toys, &["is not empty", "--resume", "--overwrite"]);
    fails(here.path(), &["generate", "toys", "--out", &toys], 1, &["not empty"]);
    fails(here.path(), &["generate", "nothing", "--out", "new"], 1, &["no scene", "toys"]);
    fails(here.path(), &["generate", "toys", "--out", "new", "--views", "1"], 1, &["at least 3"]);
    assert!(!here.path().join("new").exists());
}

#[test]
fn files_that_are_no_checkpoint_are_explained() {
    let here = folder();
    let toys = toys(here.path());
    let render = |run: &str, parts: &[&str]| {
        fails(here.path(), &["render", run, "--orbit", "1", "--out", "views"], 1, parts);
        fails(here.path(), &["eval", run, &toys], 1, parts);
        assert!(!here.path().join("views").exists());
    };
    render("nowhere", &["nowhere does not exist", "nerf train --out"]);
    render(&toys, &["has no checkpoint.safetensors"]);
    fs::write(here.path().join("note.txt"), "this is no checkpoint at all").expect("writable");
    render("note.txt", &["note.txt", "expected a safetensors file"]);
    fs::write(here.path().join("void"), "").expect("writable");
    render("void", &["cut short"]);
    let header = r#"{"__metadata__":{"nerf":"{\"format\":77}"}}"#;
    let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
    bytes.extend(header.as_bytes());
    fs::write(here.path().join("newer"), &bytes).expect("writable");
    let expected = format!("expected format {FORMAT}, found 77");
    render("newer", &[&expected, "another version"]);
}

#[test]
fn json_is_one_object_also_when_failing() {
    let here = folder();
    let object =
        |args: &[&str], code: i32| -> Value { answer(nerf().current_dir(here.path()).args(args), code) };
    let listing = object(&["adapters"], 0);
    let adapter = &listing["adapters"][0];
    assert_eq!(adapter["index"], 0);
    assert!(adapter["limits"]["maxStorageBuffersPerShaderStage"].as_u64() >= Some(8), "{adapter}");
    assert!(adapter["subgroup_sizes"].is_array() && adapter["cooperative_matrices"].is_array(), "{adapter}");
    let made = object(&["generate", "fog", "--views", "3", "--size", "8x6", "--out", "fog"], 0);
    assert_eq!((&made["scene"], &made["views"]), (&Value::from("fog"), &Value::from(3)));
    assert_eq!(object(&["generate", "--list"], 0)["scenes"].as_array().map(Vec::len), Some(3));
    for args in [["train", "nowhere", "--out", "run"], ["eval", "nowhere", "fog", "--quiet"]] {
        let error = object(&args, 1);
        assert!(error["error"].as_str().is_some_and(|text| text.contains("nowhere")), "{error}");
        assert_eq!(error.as_object().map(serde_json::Map::len), Some(1));
    }
}

#[test]
fn quiet_means_quiet() {
    let here = folder();
    let args = ["generate", "fog", "--views", "3", "--size", "8", "--out", "fog", "--quiet"];
    nerf().current_dir(here.path()).args(args).assert().success().stderr("").stdout(contains("3 views"));
}

/// The loader of Vulkan drivers takes its list from this variable on Linux.
#[cfg(target_os = "linux")]
#[test]
fn without_an_adapter_the_message_says_what_to_install() {
    let here = folder();
    let toys = toys(here.path());
    for args in [&["adapters"][..], &["train", &toys, "--out", "run", "--steps", "1"]] {
        let mut command = nerf();
        command.current_dir(here.path()).args(args).env("VK_DRIVER_FILES", "/nothing");
        command.env("VK_ICD_FILENAMES", "/nothing").assert().code(1).stderr(contains("mesa-vulkan-drivers"));
    }
    assert!(!here.path().join("run").exists());
}

/// Whoever reads the output may stop doing so.
#[cfg(unix)]
#[test]
fn a_broken_pipe_is_success() {
    use std::process::{Command, Stdio};
    let mut child = Command::new(assert_cmd::cargo::cargo_bin!("nerf"))
        .args(["generate", "--list"])
        .stdout(Stdio::piped())
        .spawn()
        .expect("starts");
    drop(child.stdout.take());
    assert_eq!(child.wait().expect("ends").code(), Some(0));
}

/// Mesa's complaint about a machine without a desktop looks like an error of ours.
#[test]
fn drivers_do_not_complain_about_the_environment() {
    for folder in [None, Some(""), Some("relative"), Some("/nowhere")] {
        let mut command = nerf();
        match folder {
            None => command.env_remove("XDG_RUNTIME_DIR"),
            Some(folder) => command.env("XDG_RUNTIME_DIR", folder),
        };
        command.arg("adapters").assert().success().stderr("");
    }
}
