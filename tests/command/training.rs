//! Training, resuming, measuring and rendering from end to end, on whatever adapter there is.

use crate::program::{SMOKE, checkpoint, generated, number, object, place, quietly, rows, text, train};
use nerf::camera::LensKind;
use nerf::capture::dataset::{Dataset, OpenOptions};
use nerf::capture::image_file::read_exr_channel;
use nerf::config::Config;
use nerf::config::schedule::Budget;
use nerf::field::trainer::Trainer;
use nerf::gpu::{Gpu, adapter};
use nerf::run::{
    EvaluationAtEnd, EvaluationOptions, Event, NoTestViews, Observer, Resolved, RunFolder, TrainOptions,
    TrainingRun,
};
use nerf::support::interrupt::Interrupt;
use predicates::str::contains;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

/// In decibels. The smoke test reaches 27.6 on a CPU adapter. With a wrong factor in the density gradient it
/// reached 20.1, with the background behind every sample 22.3, and without the gradient of the features 19.2.
const GATE_DB: f64 = 25.5;

static TOYS: LazyLock<PathBuf> =
    LazyLock::new(|| generated("toys", "toys", &["--views", "40", "--size", "60"]));

#[test]
fn a_short_training_learns_the_scene() {
    let run = place("smoke");
    let result = train(&TOYS, &run, &["--steps", "1200", "--eval-every", "600"]);
    let psnr = number(&result["psnr"]);
    assert!(psnr > GATE_DB, "{psnr} dB");
    assert!(number(&result["ssim"]) > 0.85 && result["steps"] == 1200 && result["views"] == 5);
    let memory = &result["memory"];
    if memory["peak_bytes"].is_number() && rows(&run)[0]["adapter"].to_string().contains("llvmpipe") {
        let stated = number(&memory["host_bytes"]) + number(&memory["device_bytes"]);
        let ratio = stated / number(&memory["peak_bytes"]);
        assert!((1.0 / 1.5..1.5).contains(&ratio), "{memory}");
    }
    let rows = rows(&run);
    assert!(rows[0]["event"] == "start" && rows[0]["compile_seconds"].is_number());
    let steps: Vec<&Value> = rows.iter().filter(|row| row.get("loss").is_some()).collect();
    assert!(
        steps.len() >= 75 && steps.windows(2).all(|pair| number(&pair[0]["step"]) < number(&pair[1]["step"]))
    );
    for row in &steps {
        for key in ["step", "seconds", "loss", "psnr", "rays", "samples", "marched", "learning_rate"] {
            assert!(row[key].is_number(), "{key} in {row}");
        }
        assert_eq!(row["skipped"], 0);
    }
    assert!(rows[0]["left_out"].is_array() && rows[0]["driver"].is_string());
    let timed = rows.iter().rfind(|row| row["event"] == "stages");
    let stages = timed.and_then(|row| row["stages"].as_array()).map_or(0, Vec::len);
    assert!(
        stages > 15 || !rows[0]["adapter"].to_string().contains("llvmpipe"),
        "{stages} stages were timed"
    );
    let measured: Vec<&Value> = rows.iter().filter(|row| row.get("eval_psnr").is_some()).collect();
    assert_eq!(
        measured.iter().map(|row| row["views"].as_u64()).collect::<Vec<_>>(),
        [Some(4), Some(4), Some(5)]
    );

    let eval = object(&["eval", text(&run), text(&TOYS)]);
    assert!((number(&eval["psnr"]) - psnr).abs() < 0.01, "{} {psnr}", eval["psnr"]);
    assert_eq!(
        (eval["views"].as_array().map(Vec::len), &eval["background"]),
        (Some(5), &Value::from("black"))
    );
    renders_the_depth_of_the_scene(&run);
    renders_an_orbit_without_its_dataset(&run);
}

/// Z of rendered test views against the generator's ground truth.
fn renders_the_depth_of_the_scene(run: &Path) {
    let out = place("views");
    let cameras = TOYS.join("transforms_test.json");
    let args = ["render", text(run), "--out", text(&out), "--cameras", text(&cameras), "--frames", "1..3"];
    quietly(&[&args[..], &["--format", "exr", "--format", "png", "--depth"]].concat()).assert().success();
    let listing = fs::read_to_string(out.join("frames.json")).expect("a listing");
    let listing: Value = serde_json::from_str(&listing).expect("JSON");
    assert_eq!(listing["frames"].as_array().map(Vec::len), Some(2));
    assert_eq!(listing["frames"][0]["source"], "./test/0001");
    for index in 1..3 {
        let truth = TOYS.join(format!("test/000{index}_depth.exr"));
        let ours = out.join(format!("000{index}.exr"));
        assert!(
            out.join(format!("000{index}.png")).exists()
                && out.join(format!("000{index}_depth.png")).exists()
        );
        let channel = |path: &Path, name| read_exr_channel(path, name).expect("the channel").2;
        let (z, true_z) = (channel(&ours, "Z"), channel(&truth, "Z"));
        let (alpha, true_alpha) = (channel(&ours, "A"), channel(&truth, "A"));
        let mut errors: Vec<f32> = (0..z.len())
            .filter(|&i| alpha[i] > 0.95 && true_alpha[i] > 0.999)
            .map(|i| (z[i] - true_z[i]).abs())
            .collect();
        errors.sort_by(f32::total_cmp);
        assert!(errors.len() > 200, "{} opaque pixels", errors.len());
        // The cameras are 4 units away from a scene that is about 2.5 wide.
        let median = errors[errors.len() / 2];
        assert!(median < 0.06, "the median error of the depth is {median}");
        let alpha_error: f32 = alpha.iter().zip(&true_alpha).map(|(a, b)| (a - b).abs()).sum();
        assert!(alpha_error / (alpha.len() as f32) < 0.05, "{alpha_error}");
    }
}

fn renders_an_orbit_without_its_dataset(run: &Path) {
    let (alone, out) = (place("alone.safetensors"), place("orbit"));
    fs::copy(run.join("checkpoint.safetensors"), &alone).expect("copied");
    let args = ["render", text(&alone), "--out", text(&out), "--orbit", "2", "--width", "24", "--half"];
    let result = object(&[&args[..], &["--format", "exr"]].concat());
    assert_eq!(result["frames"], 2);
    let (width, height, alpha) = read_exr_channel(&out.join("0001.exr"), "A").expect("alpha");
    assert_eq!((width, height), (24, 24));
    assert!(alpha.iter().any(|&a| a > 0.9) && alpha.iter().any(|&a| a < 0.1), "an object before nothing");
    let missing = ["render", text(&alone), "--out", text(&out), "--orbit", "2", "--frames", "1..3"];
    quietly(&missing).assert().code(1).stderr(contains("within 0..2"));
}

/// A constant learning rate, so that a stop in the middle makes no difference.
const CONSTANT_RATE: [&str; 4] =
    ["--set", "optimizer.learning_rate=0.01", "--set", "optimizer.final_learning_rate=0.01"];

#[test]
fn two_halves_are_a_whole() {
    let (whole, halves) = (place("whole"), place("halves"));
    let constant = [&CONSTANT_RATE[..], &["--no-eval", "--steps"]].concat();
    train(&TOYS, &whole, &[&constant[..], &["72"]].concat());
    train(&TOYS, &halves, &[&constant[..], &["40"]].concat());
    train(&TOYS, &halves, &["--no-eval", "--resume", "--steps", "72"]);
    same_field(&whole, &halves);
    let steps: Vec<u64> =
        rows(&halves).iter().filter_map(|row| row["loss"].as_f64().and(row["step"].as_u64())).collect();
    assert_eq!(steps, [16, 32, 40, 56, 72]);
    let again = train(&TOYS, &halves, &["--no-eval", "--resume"]);
    assert_eq!(again["steps"], 72, "nothing is left to do");
    quietly(&["train", text(&TOYS), "--out", text(&halves), "--resume", "--set", "grid.levels=16"])
        .assert()
        .code(1)
        .stderr(contains("cannot change its grid"));
}

/// Ctrl-C in the middle of a schedule, which goes on as if nothing had happened.
#[cfg(unix)]
#[test]
fn an_interrupted_training_goes_on() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    let (whole, parts) = (place("at_once"), place("interrupted"));
    train(&TOYS, &whole, &["--no-eval", "--steps", "300"]);
    let mut child = Command::new(assert_cmd::cargo::cargo_bin!("nerf"))
        .args(["train", text(&TOYS), "--out", text(&parts), "--config", SMOKE, "--steps", "300", "--quiet"])
        .stdout(Stdio::null())
        .spawn()
        .expect("starts");
    let clock = Instant::now();
    let is_under_way = || parts.join("log.jsonl").exists() && rows(&parts).len() > 2;
    while !is_under_way() && clock.elapsed() < Duration::from_secs(120) {
        std::thread::sleep(Duration::from_millis(20));
    }
    for how in ["--resume", "--overwrite"] {
        let second = quietly(&["train", text(&TOYS), "--out", text(&parts), how]).assert();
        second.code(3).stderr(contains(format!("process {} writes to it", child.id())));
    }
    let signalled = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(signalled.expect("kill runs").success());
    assert_eq!(child.wait().expect("ends").code(), Some(130), "scripts stop");
    let step = checkpoint(&parts).metadata.step;
    assert!((16..300).contains(&step), "interrupted at {step}");
    train(&TOYS, &parts, &["--no-eval", "--resume"]);
    same_field(&whole, &parts);
}

/// Bit for bit where the sums of gradients do not depend on the order of threads, which a CPU's do not.
fn same_field(one: &Path, other: &Path) {
    let (one, other) = (checkpoint(one), checkpoint(other));
    assert_eq!(one.state.step, other.state.step);
    if one.metadata.adapter.contains("llvmpipe") {
        assert!(one.state == other.state, "the fields differ");
    }
    let sum = |table: &[f32]| table.iter().map(|&value| f64::from(value).abs()).sum::<f64>();
    let (a, b) = (sum(one.state.floats("table")), sum(other.state.floats("table")));
    assert!((a - b).abs() < 0.05 * a, "{a} {b}");
}

#[test]
fn held_out_views_stay_held_out() {
    let (dataset, run) = (generated("toys", "single", &["--views", "11", "--size", "16"]), place("held"));
    fs::rename(dataset.join("transforms_train.json"), dataset.join("transforms.json")).expect("renamed");
    for split in ["val", "test"] {
        fs::remove_file(dataset.join(format!("transforms_{split}.json"))).expect("removed");
    }
    train(&dataset, &run, &["--steps", "20", "--hold-out", "4", "--background", "random"]);
    let splits = checkpoint(&run).metadata.splits;
    assert_eq!(splits.test, ["./train/0000", "./train/0004", "./train/0008"]);
    assert!(splits.test.iter().all(|name| !splits.train.contains(name)));
    let eval = object(&["eval", text(&run), text(&dataset), "--background", "white"]);
    let files: Vec<_> =
        eval["views"].as_array().expect("views").iter().map(|view| view["file"].clone()).collect();
    assert_eq!(files, splits.test);
    let elsewhere = ["train", text(&TOYS), "--out", text(&run), "--resume"];
    quietly(&elsewhere).assert().code(1).stderr(contains("resume with"));
}

/// A linear field, lenses of every kind, cascades: a few steps and a view of each.
#[test]
fn every_kind_of_scene_trains() {
    let small = ["--views", "6", "--size", "24x16", "--samples", "1"];
    use LensKind::{Fisheye, OpenCv, Orthographic, Pinhole};
    let scenes = [
        ("courtyard", "--lens", vec![OpenCv]),
        ("fog", "--hdr", vec![Pinhole]),
        // Four views to train on.
        ("toys", "--lens=mixed", vec![Pinhole, OpenCv, Fisheye, Orthographic]),
    ];
    for (scene, further, lenses) in scenes {
        let dataset = generated(scene, &format!("{scene}_of_every_kind"), &[&small[..], &[further]].concat());
        let (run, out) = (place(&format!("{scene}_run")), place(&format!("{scene}_views")));
        let result = train(&dataset, &run, &["--steps", "24"]);
        assert!(number(&result["psnr"]) > 4.0, "{scene}: {result}");
        let metadata = checkpoint(&run).metadata;
        assert_eq!(metadata.features.lenses, lenses.into_iter().collect());
        assert_eq!(
            (metadata.features.hdr, metadata.bounds.cascades > 1),
            (scene == "fog", scene == "courtyard")
        );
        let cameras = dataset.join("transforms_test.json");
        let args = ["render", text(&run), "--out", text(&out), "--cameras", text(&cameras)];
        quietly(&[&args[..], &["--format", "png", "--format", "exr", "--background", "white"]].concat())
            .assert()
            .success();
        assert_eq!(read_exr_channel(&out.join("0000.exr"), "Z").expect("depth").0, 24);
    }
}

/// Far too high a learning rate ends with a message or in a field that is all numbers.
#[test]
fn far_too_high_learning_rates() {
    for rate in ["1", "1000"] {
        let run = place(&format!("rate_{rate}"));
        let rate = format!("optimizer.learning_rate={rate}");
        let args =
            ["train", text(&TOYS), "--out", text(&run), "--config", SMOKE, "--steps", "64", "--set", &rate];
        let output = quietly(&args).assert().get_output().clone();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        let result = String::from_utf8_lossy(&output.stdout).into_owned();
        match output.status.code() {
            Some(0) => {
                checkpoint(&run);
                assert!(rate == "optimizer.learning_rate=1" || result.contains("smaller"), "{result}");
            }
            Some(1) => assert!(message.contains("learning_rate"), "{message}"),
            other => panic!("exit code {other:?}: {message}"),
        }
    }
}

/// In any number of threads, and with the clock at another time. A software driver's threads are counted by
/// `LP_NUM_THREADS`.
#[test]
fn deterministic_runs_are_equal_bit_for_bit() {
    for accumulation in ["auto", "fixed"] {
        let set = format!("accumulation={accumulation}");
        let bytes = |threads: &str, steps: &[&str]| {
            let run = place(&format!("deterministic_{accumulation}_{threads}"));
            for (number, steps) in steps.iter().enumerate() {
                let args = [
                    "train",
                    text(&TOYS),
                    "--out",
                    text(&run),
                    "--deterministic",
                    "--no-eval",
                    "--set",
                    &set,
                ];
                let mut command = quietly(&args);
                command.args(CONSTANT_RATE).args(["--steps", steps]);
                match number {
                    0 => command.args(["--config", SMOKE]),
                    _ => command.arg("--resume"),
                };
                command.env("LP_NUM_THREADS", threads).assert().success();
            }
            fs::read(run.join("checkpoint.safetensors")).expect("a checkpoint")
        };
        let first = bytes("1", &["48"]);
        assert!(first == bytes("2", &["48"]), "{accumulation}: the checkpoints differ");
        assert!(first == bytes("3", &["20", "48"]), "{accumulation}: the resumed checkpoint differs");
    }
    let run = place("deterministic_seconds");
    let args = ["train", text(&TOYS), "--out", text(&run), "--set", "deterministic=true", "--seconds", "3"];
    quietly(&args).assert().code(1).stderr(contains("--steps"));
    let args =
        ["train", text(&TOYS), "--out", text(&run), "--deterministic", "--set", "accumulation=exchange"];
    quietly(&args).assert().code(1).stderr(contains("accumulation must be auto"));
}

/// The kinds of what a run tells; asks it to stop after so many steps.
struct Listener {
    told: Vec<&'static str>,
    stop: Interrupt,
    last_step: u32,
}

impl Observer for Listener {
    fn notice(&mut self, event: &Event<'_>) {
        if matches!(event, Event::Steps(taken) if taken.step >= self.last_step) {
            self.stop.raise();
        }
        let kind = match event {
            Event::Resolved { .. } => "resolved",
            Event::Memory(_) => "memory",
            Event::Depth(_) => "depth",
            Event::Loading { .. } => "loading",
            Event::Steps(_) => "steps",
            Event::Evaluated { .. } => "evaluated",
            Event::Saved { .. } => "saved",
            Event::Ended => "ended",
            Event::Measuring { .. } => "measuring",
            Event::Warning(_) => "warning",
        };
        if self.told.last() != Some(&kind) {
            self.told.push(kind);
        }
    }
}

#[test]
fn a_run_without_a_terminal_tells_what_happens_and_stops_when_asked() {
    let dataset = Dataset::open(&TOYS, &OpenOptions::default()).expect("a dataset");
    let path = place("library");
    let mut listener = Listener { told: Vec::new(), stop: Interrupt::default(), last_step: 32 };
    let train = |end: u32, listener: &mut Listener| {
        let mut gpu = Gpu::open(&adapter::choose(None).expect("an adapter")).expect("it opens");
        gpu.interrupt = listener.stop.clone();
        let gpu = Arc::new(gpu);
        let budget = Budget { steps: Some(end), seconds: None };
        let options = TrainOptions { config: Some(PathBuf::from(SMOKE)), budget, ..TrainOptions::default() };
        let (folder, resolved) = match RunFolder::to_resume(&path) {
            Ok((folder, opened)) => (folder, Resolved::resume(&options, &dataset, &gpu, opened.checkpoint)),
            Err(_) => (RunFolder::unused(&path).expect("empty"), Resolved::new_run(&options, &dataset, &gpu)),
        };
        let evaluation = EvaluationOptions { every: Some(16), at_end: EvaluationAtEnd::All };
        let resolved = resolved.expect("it fits");
        let saving = Default::default();
        let run =
            TrainingRun { gpu, dataset: &dataset, resolved, folder, evaluation, saving, overcommit: false };
        let mut session = run.begin(listener).expect("it begins");
        let end = session.train(listener).expect("it trains");
        let views = session.evaluate(&end, listener).expect("measured");
        let page = session.write_report(&end, Err("not asked for".to_owned())).expect("written");
        assert!(page.is_file());
        (end, views)
    };
    let (end, views) = train(64, &mut listener);
    assert!(end.step == 32 && end.interrupted && views == Err(NoTestViews::Interrupted), "{end:?}");
    listener.told.retain(|kind| *kind != "steps");
    assert_eq!(listener.told, ["resolved", "memory", "loading", "evaluated", "saved", "ended"]);
    (listener.stop, listener.last_step) = (Interrupt::default(), u32::MAX);
    let (end, views) = train(48, &mut listener);
    assert!(end.step == 48 && !end.interrupted, "{end:?}");
    assert_eq!(views.map(|views| views.count()), Ok(5));
    assert_eq!(listener.told.last(), Some(&"measuring"));
    let log = RunFolder::new(&path).log().expect("a log");
    assert_eq!((log.starts.len(), log.damaged, log.steps.last().map(|row| row.step)), (2, 0, Some(48)));
}

#[test]
fn a_trainer_on_a_dataset_takes_its_photos_as_they_are() {
    let gpu = Arc::new(Gpu::open(&adapter::choose(None).expect("an adapter")).expect("it opens"));
    let linear = generated("fog", "linear", &["--views", "12", "--size", "24", "--hdr"]);
    for path in [&linear, &*TOYS] {
        let dataset = Dataset::open(path, &OpenOptions::default()).expect("a dataset");
        let mut config = Config::for_dataset(&dataset, gpu.is_cpu()).expect("a preset");
        config.merge_file(Path::new(SMOKE)).expect("settings");
        let mut trainer = Trainer::on(&gpu, &dataset, config).expect("a trainer");
        let features = &trainer.plan().features;
        assert_eq!((features.hdr, features.grey != 1.0), (dataset.is_hdr, dataset.is_hdr), "{features:?}");
        trainer.step(1e-2, None).expect("a step");
        assert!(trainer.report().expect("a report").loss.is_finite());
    }
}
