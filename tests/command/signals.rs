//! Signals and exit codes: what a terminal, a script or a scheduler does to the program, and what it learns from it.

use crate::program::{SMOKE, checkpoint, generated, place, text};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::LazyLock;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Far too many steps, so that no training comes to its end.
const ENDLESS: [&str; 2] = ["--steps", "1000000"];

static TOYS: LazyLock<PathBuf> =
    LazyLock::new(|| generated("toys", "toys", &["--views", "20", "--size", "60"]));

/// A process of the program that is under way.
struct Running(Child);

impl Running {
    fn start(command: &mut Command) -> Self {
        let command = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        Self(command.spawn().expect("starts"))
    }

    fn nerf(args: &[&str]) -> Self {
        Self::start(Command::new(assert_cmd::cargo::cargo_bin!("nerf")).args(args))
    }

    /// Waits until `is_so`, which comes before the end.
    fn until(mut self, is_so: impl Fn() -> bool) -> Self {
        let start = Instant::now();
        while !is_so() {
            assert!(start.elapsed() < Duration::from_secs(120), "it takes too long");
            assert_eq!(self.0.try_wait().expect("a child"), None, "it has ended");
            sleep(Duration::from_millis(5));
        }
        self
    }

    fn signal(self, name: &str) -> Self {
        let sent = Command::new("kill").args([&format!("-{name}"), &self.0.id().to_string()]).status();
        assert!(sent.expect("kill runs").success());
        self
    }

    /// The end: the exit code, and what was said on both streams.
    fn end(self) -> (Option<i32>, String, String) {
        let Output { status, stdout, stderr } = self.0.wait_with_output().expect("ends");
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        (status.code(), text(stdout), text(stderr))
    }
}

/// Whether a training of `run` has taken steps.
fn is_training(run: &Path) -> bool {
    std::fs::read_to_string(run.join("log.jsonl")).is_ok_and(|log| log.lines().count() > 2)
}

/// Whether a file is there.
fn is_there(path: PathBuf) -> impl Fn() -> bool {
    move || path.exists()
}

/// The files of a folder, none of which is temporary.
fn whole_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder");
    let files: Vec<_> = entries.map(|entry| entry.expect("readable").path()).collect();
    assert!(files.iter().all(|file| file.extension().is_none_or(|end| end != "part")), "{files:?}");
    files
}

#[test]
fn every_signal_saves_a_training() {
    // Where these tests are run by nohup, so is what they start.
    let is_ignored = std::fs::read_to_string("/proc/self/status").is_ok_and(|status| {
        status.lines().any(|line| {
            line.starts_with("SigIgn:") && !line.ends_with(['0', '2', '4', '6', '8', 'a', 'c', 'e'])
        })
    });
    let signals = [("INT", 130), ("TERM", 143), ("HUP", 129)];
    for (name, code) in signals.into_iter().filter(|(name, _)| *name != "HUP" || !is_ignored) {
        let run = place(name);
        let args = ["train", text(&TOYS), "--out", text(&run), "--config", SMOKE, "--quiet"];
        let running = Running::nerf(&[&args[..], &ENDLESS].concat()).until(|| is_training(&run));
        let (found, said, errors) = running.signal(name).end();
        assert_eq!((found, errors.as_str()), (Some(code), ""), "{said}");
        assert!(said.starts_with("interrupted after ") && said.ends_with("go on with --resume\n"), "{said}");
        assert!(checkpoint(&run).metadata.step > 0 && !whole_files(&run).is_empty());
    }
}

#[test]
fn a_signal_while_loading_leaves_nothing() {
    let run = place("loading");
    let pipe = place("a pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo runs").success());
    let args = ["train", text(&TOYS), "--out", text(&run), "--config", text(&pipe)];
    for json in [false, true] {
        let json = if json { &["--json"][..] } else { &[] };
        let running = Running::nerf(&[&args[..], json].concat());
        // It opens once the program reads.
        let _pipe = std::fs::File::create(&pipe).expect("a reader");
        let (code, said, errors) = running.signal("TERM").end();
        assert_eq!((code, errors.as_str()), (Some(143), "error: interrupted by SIGTERM\n"));
        assert_eq!(said.is_empty(), json.is_empty());
        if let Ok(answer) = serde_json::from_str::<Value>(&said) {
            assert_eq!(answer["error"], "interrupted by SIGTERM");
        }
    }
    let left = whole_files(&run);
    assert!(left.iter().all(|file| file.ends_with(".nerf-lock")), "{left:?}");
}

#[test]
fn signals_while_measuring_and_rendering() {
    let (run, saved, views) = (place("run"), place("saved"), place("views"));
    let args = ["train", text(&TOYS), "--out", text(&run), "--config", SMOKE, "--steps", "20", "--json"];
    let large = generated("toys", "large", &["--views", "40", "--size", "200", "--samples", "1"]);
    let measuring = [&["train", text(&large)], &args[2..], &["--quiet", "--eval-all"]].concat();
    let running = Running::nerf(&measuring).until(is_there(run.join("checkpoint.safetensors")));
    let (code, said, errors) = running.signal("TERM").end();
    assert_eq!((code, errors.as_str()), (Some(143), ""), "{said}");
    let result: Value = serde_json::from_str(&said).expect("one JSON value");
    assert_eq!((&result["steps"], &result["interrupted"]), (&20.into(), &true.into()), "{said}");
    assert!(whole_files(&run).contains(&run.join("report.html")));

    let eval = ["eval", text(&run), text(&large), "--split", "train", "--save", text(&saved), "--quiet"];
    let has_pictures = || std::fs::read_dir(&saved).is_ok_and(|files| files.count() > 2);
    let running = Running::nerf(&eval).until(has_pictures);
    let ended = running.signal("INT").end();
    assert_eq!(ended, (Some(130), String::new(), "error: interrupted by SIGINT\n".to_owned()));

    let render = ["render", text(&run), "--orbit", "1000", "--out", text(&views), "--quiet"];
    let running = Running::nerf(&render).until(is_there(views.join("0001.png")));
    let (code, said, errors) = running.signal("TERM").end();
    assert_eq!((code, said.as_str()), (Some(143), ""), "{errors}");
    assert!(errors.starts_with("error: interrupted by SIGTERM"), "{errors}");
    for folder in [saved, views] {
        let is_picture = |file: &PathBuf| file.extension().is_some_and(|end| end == "png");
        for picture in whole_files(&folder).into_iter().filter(is_picture) {
            image::open(picture).expect("a whole picture");
        }
    }
}

#[test]
fn a_killed_generation_is_begun_again() {
    let out = place("killed");
    let generate =
        |size| ["generate", "toys", "--views", "200", "--samples", "1", "--size", size, "--out", text(&out)];
    let running = Running::nerf(&generate("300")).until(is_there(out.join("train/0000.png")));
    assert_eq!(running.signal("KILL").end().0, None);
    assert!(!out.join("transforms_train.json").exists());
    let (code, _, errors) = Running::nerf(&generate("8")).end();
    assert_eq!(code, Some(0), "{errors}");
    let picture = image::image_dimensions(out.join("train/0000.png")).expect("a picture");
    let left: Vec<_> = whole_files(&out).into_iter().filter(|file| file.is_file()).collect();
    assert_eq!((picture, left.len()), ((8, 8), 3), "{left:?}");
    let (code, _, errors) = Running::nerf(&generate("8")).end();
    assert!(code == Some(1) && errors.contains("is not empty"), "a whole one stays: {errors}");
}

/// As nohup starts it.
#[cfg(target_os = "linux")]
#[test]
fn an_ignored_hangup_stays_ignored() {
    let run = place("nohup");
    let args = ["train", text(&TOYS), "--out", text(&run), "--config", SMOKE, "--quiet"];
    let script = "trap '' HUP; exec \"$0\" \"$@\"";
    let mut command = Command::new("sh");
    command.args(["-c", script]).arg(assert_cmd::cargo::cargo_bin!("nerf")).args(args).args(ENDLESS);
    let running = Running::start(&mut command).until(|| is_training(&run)).signal("HUP");
    let rows = || std::fs::read_to_string(run.join("log.jsonl")).map_or(0, |log| log.lines().count());
    let before = rows();
    let (code, said, _) = running.until(|| rows() > before + 2).signal("TERM").end();
    assert_eq!(code, Some(143), "{said}");
}

/// What a scheduler runs again and again, whatever happened in between.
#[test]
fn one_command_line_starts_resumes_and_ends() {
    let run = place("queued");
    let args =
        ["train", text(&TOYS), "--out", text(&run), "--config", SMOKE, "--resume-or-start", "--no-eval"];
    let more = ["--steps", "400", "--seed", "3", "--set", "grid.levels=8", "--background", "white"];
    let again = || Running::nerf(&[&args[..], &more, &["--json"]].concat());
    // A process that was killed before it saved leaves so much.
    std::fs::create_dir(&run).expect("writable");
    for (file, text) in
        [("config.json", "{}"), ("log.jsonl", "{\"st"), (".nerf-abcdef.part", "half"), ("job.log", "")]
    {
        std::fs::write(run.join(file), text).expect("writable");
    }
    let (code, said, _) = again().until(|| is_training(&run)).signal("TERM").end();
    assert_eq!(code, Some(143), "{said}");
    let reached = checkpoint(&run).metadata.step;
    assert!((1..400).contains(&reached), "{reached}");
    for _ in 0..2 {
        let (code, said, errors) = again().end();
        let result: Value = serde_json::from_str(&said).expect("one JSON value");
        assert_eq!((code, &result["steps"]), (Some(0), &400.into()), "{errors}");
    }
    assert!(run.join("job.log").exists() && !whole_files(&run).is_empty());
    // What was saved must not be replaced by a new start.
    let file = run.join("checkpoint.safetensors");
    for checkpoint in whole_files(&run).iter().filter(|file| file.extension() == Some("safetensors".as_ref()))
    {
        std::fs::remove_file(checkpoint).expect("removable");
    }
    std::fs::write(&file, "damaged").expect("writable");
    let (code, said, errors) = again().end();
    assert_eq!(code, Some(1), "{said}");
    assert!(errors.contains("checkpoint.safetensors cannot be used"), "{errors}");
    assert_eq!(std::fs::read(&file).expect("kept"), b"damaged");
}

/// The end of a command whose files or output can take no more.
#[cfg(target_os = "linux")]
#[test]
fn full_disks_are_worth_another_try() {
    let run = place("full");
    let args = [
        "train",
        text(&TOYS),
        "--out",
        text(&run),
        "--config",
        SMOKE,
        "--steps",
        "16",
        "--no-eval",
        "--quiet",
    ];
    let script = |script: &str| {
        let mut command = Command::new("bash");
        command.args(["-c", script]).arg(assert_cmd::cargo::cargo_bin!("nerf"));
        command
    };
    let (code, said, errors) = Running::start(script("exec \"$0\" \"$@\" > /dev/full").args(args)).end();
    assert_eq!((code, said.as_str()), (Some(3), ""));
    let expected = format!("error: the run is saved to {}: the result could not be printed: ", run.display());
    assert!(errors.starts_with(&expected) && errors.lines().count() == 1, "{errors}");
    assert_eq!(checkpoint(&run).metadata.step, 16);

    let dataset = place("too_large");
    let generate = ["generate", "toys", "--out", text(&dataset), "--views", "4", "--size", "400", "--hdr"];
    let (code, _, errors) = Running::start(script("ulimit -f 100; exec \"$0\" \"$@\"").args(generate)).end();
    assert_eq!(code, Some(3), "{errors}");
    let (code, _, errors) =
        Running::start(script("ulimit -n 5; exec \"$0\" \"$@\"").args(["info", text(&TOYS)])).end();
    assert_eq!(code, Some(3), "{errors}");
    let (code, _, errors) = Running::nerf(&["info", text(&dataset.join("missing"))]).end();
    assert_eq!(code, Some(1), "{errors}");
}
