//! What `scripts/endurance.sh` does a hundred times, a few times: folders that vanish, disks that are full, processes that are
//! killed.
#![cfg(unix)]

use crate::program::{SMOKE, checkpoint, generated, nerf, place, rows, text, train};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::LazyLock;
use std::thread::sleep;
use std::time::Duration;

static TOYS: LazyLock<PathBuf> =
    LazyLock::new(|| generated("toys", "toys", &["--views", "11", "--size", "16"]));

const STEPS: &str = "400";

/// A training that all of these are like.
fn arguments<'a>(run: &'a Path, further: &[&'a str]) -> Vec<&'a str> {
    let args = ["train", text(&TOYS), "--out", text(run), "--config", SMOKE, "--steps", STEPS, "--no-eval"];
    [&args, &["--deterministic"][..], further].concat()
}

fn start(arguments: &[&str]) -> Child {
    let mut command = Command::new(nerf().get_program());
    let command = command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    command.spawn().expect("starts")
}

/// Its exit code, and what it said.
fn end(child: Child) -> (Option<i32>, String) {
    let Output { status, stderr, .. } = child.wait_with_output().expect("ends");
    (status.code(), String::from_utf8(stderr).expect("UTF-8"))
}

/// Waits until `is_so`, or the process has ended.
fn wait_until(child: &mut Child, is_so: impl Fn() -> bool) {
    while !is_so() && child.try_wait().expect("a child").is_none() {
        sleep(Duration::from_millis(2));
    }
}

/// How many lines a run has logged.
fn lines(run: &Path) -> usize {
    fs::read_to_string(run.join("log.jsonl")).map_or(0, |log| log.lines().count())
}

/// The hidden files of a folder: locks, and what is being written.
fn hidden(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    names.filter(|name| name.starts_with('.')).collect()
}

fn steps(run: &Path) -> Vec<u64> {
    rows(run).iter().filter_map(|row| row["loss"].as_f64().and(row["step"].as_u64())).collect()
}

#[test]
fn a_folder_that_vanishes_is_made_again() {
    let run = place("vanishes");
    let mut training = start(&arguments(&run, &[]));
    wait_until(&mut training, || lines(&run) > 2);
    // Moved first: a folder that is written to may not be removed at once.
    let away = run.with_file_name("away");
    fs::rename(&run, &away).expect("movable");
    fs::write(&run, "in the way").expect("writable");
    sleep(Duration::from_millis(300));
    fs::remove_file(&run).expect("removable");
    let (code, said) = end(training);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("was removed; it is made again"), "{said}");
    assert_eq!(checkpoint(&run).state.step, 400);
    let steps = steps(&run);
    assert!(rows(&run)[0]["event"] == "start" && steps[0] == 16 && steps.last() == Some(&400), "{steps:?}");
    assert!(run.join("config.json").exists());
    assert!(hidden(&run).is_empty(), "nothing is left behind");
}

/// A limit on the size of files, in kilobytes, stands for a disk that is full: the log has room, and a checkpoint has none.
#[test]
fn a_disk_that_is_full_does_not_end_a_training() {
    let run = place("full");
    train(&TOYS, &run, &["--steps", "16", "--no-eval", "--deterministic"]);
    let before = fs::read(run.join("checkpoint.safetensors")).expect("saved");
    let program = nerf().get_program().to_owned();
    let mut shell = Command::new("bash");
    shell.args(["-c", "trap '' XFSZ; ulimit -f 200; exec \"$@\"", "bash"]).arg(program);
    let Output { status, stderr, .. } =
        shell.args(arguments(&run, &["--resume"])).output().expect("bash runs");
    let said = String::from_utf8(stderr).expect("UTF-8");
    assert_eq!(status.code(), Some(3), "it may work when tried again: {said}");
    assert!(said.contains("could not save at step 400 (the checkpoint of step 16 is kept)"), "{said}");
    assert_eq!(steps(&run).last(), Some(&400), "it trained to its end");
    assert!(
        fs::read(run.join("checkpoint.safetensors")).expect("kept") == before,
        "the checkpoint is as it was"
    );
    train(&TOYS, &run, &["--steps", STEPS, "--no-eval", "--resume"]);
    assert_eq!(checkpoint(&run).state.step, 400);
}

#[test]
fn a_chain_of_kills_ends_like_an_undisturbed_training() {
    let (whole, chain) = (place("whole"), place("chain"));
    end(start(&arguments(&whole, &[])));
    let often = arguments(&chain, &["--checkpoint-every", "0.1", "--resume-or-start"]);
    for kill in 0..5 {
        let mut training = start(&often);
        let before = lines(&chain);
        wait_until(&mut training, || match kill % 2 {
            0 => lines(&chain) > before + 4,
            // In the middle of saving.
            _ => hidden(&chain).iter().any(|name| name.ends_with(".part")),
        });
        training.kill().expect("not reaped yet");
        end(training);
    }
    let (code, said) = end(start(&often));
    assert_eq!(code, Some(0), "{said}");
    let of = |run: &Path| fs::read(run.join("checkpoint.safetensors")).expect("saved");
    assert!(of(&whole) == of(&chain), "another checkpoint");
    assert!(hidden(&chain).is_empty(), "nothing is left behind");
    let steps = steps(&chain);
    assert!(steps.windows(2).all(|pair| pair[0] < pair[1]) && steps.last() == Some(&400), "{steps:?}");
}
