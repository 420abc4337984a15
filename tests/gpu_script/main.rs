//! `scripts/gpu.sh` and `scripts/gpu_results.py` from end to end, with programs that stand in for nerf and its benchmarks:
//! parts that fail, hang or find wrong kernels, and a call that is killed. Parts are given seconds, so no training runs
//! beside them in this process.
#![cfg(unix)]

use assert_cmd::Command;
use serde_json::Value;
use std::fs;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
const PARTS: usize = 27;

/// A folder of this test run that holds an unpacked bundle.
struct Machine {
    folder: PathBuf,
}

impl Machine {
    fn new(name: &str) -> Self {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("gpu_script").join(name);
        let _ = fs::remove_dir_all(&folder);
        let bin = folder.join("bundle/bin");
        fs::create_dir_all(&bin).expect("writable");
        for (stand_in, program) in
            [("nerf", "nerf"), ("bench", "ceilings"), ("bench", "step"), ("kernels", "kernels")]
        {
            copy(&format!("tests/gpu_script/{stand_in}.sh"), &bin.join(program));
        }
        copy("scripts/gpu.sh", &folder.join("bundle/gpu.sh"));
        for dataset in ["lego_200", "fox_270x480"] {
            fs::create_dir_all(folder.join("bundle/data").join(dataset)).expect("writable");
        }
        Self { folder }
    }

    fn script(&self, variables: &[(&str, &str)]) -> std::process::Command {
        let mut command = std::process::Command::new(self.folder.join("bundle/gpu.sh"));
        command.arg(self.folder.join("results")).current_dir("/").envs(variables.iter().copied());
        command
    }

    /// Runs the script, and returns its exit code.
    fn run(&self, variables: &[(&str, &str)]) -> Option<i32> {
        self.script(variables).output().expect("bash").status.code()
    }

    /// What the archive becomes: the merged results, the report and the README.
    fn results(&self) -> (Value, String, String) {
        let text = "before\n<!-- written by scripts/gpu_results.py -->\nold\n<!-- end of what scripts/gpu_results.py \
                    writes -->\nafter\n";
        let (page, readme) = self.page(text, true);
        assert!(page.to_string_lossy().ends_with("_test-gpu"), "{}", page.display());
        (merged(&page), fs::read_to_string(page.join("report.md")).expect("text"), readme)
    }

    /// The folder that the archive becomes, and what is then in a README of `text`.
    fn page(&self, text: &str, is_written: bool) -> (PathBuf, String) {
        let (pages, readme) = (self.folder.join("pages"), self.folder.join("README.md"));
        fs::write(&readme, text).expect("writable");
        let mut convert = Command::new("python3");
        convert.arg(Path::new(ROOT).join("scripts/gpu_results.py"));
        convert.args([&self.folder.join("results/results.tar.gz"), &pages, &readme]);
        let assert = convert.assert();
        if is_written {
            assert.success()
        } else {
            assert.failure()
        };
        let page = fs::read_dir(&pages).expect("pages").next().expect("a folder").expect("an entry").path();
        (page, fs::read_to_string(readme).expect("text"))
    }
}

fn merged(page: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(page.join("gpu.json")).expect("text")).expect("JSON")
}

/// Copies a program in a process of its own: what another test forks meanwhile would hold a file that is written here, and
/// nothing can run it as long as it is.
fn copy(from: &str, to: &Path) {
    Command::new("install").args(["-m", "755"]).arg(Path::new(ROOT).join(from)).arg(to).assert().success();
}

/// How many parts ended so.
fn count(merged: &Value, status: &str) -> usize {
    let parts = merged["parts"].as_object().expect("parts");
    parts.values().filter(|part| part["status"] == status).count()
}

#[test]
fn a_whole_call_is_told_in_full() {
    let machine = Machine::new("whole");
    assert_eq!(machine.run(&[]), Some(0));
    let (merged, report, readme) = machine.results();
    assert_eq!(
        (count(&merged, "done"), merged["parts"].as_object().map(|parts| parts.len())),
        (PARTS, Some(PARTS))
    );
    for line in [
        "# Test GPU (rev 2) over Vulkan",
        "- Cooperative matrices: 16x16x16 F16 into F32",
        "- `nerf check`, exchange: right",
        "- `--deterministic` twice: the same, bit for bit",
        "| multiply-adds, TFLOP/s | 50.000 |",
        "| atomics at random addresses, long integer, G/s | - |",
        "On scene: 5.00 ms a step, 50.0 million kept samples a second",
        "| encode | 0.500 | 10.0 | 2000.0 | 200.0 | 160.0 | - | 42 % gathers |",
        "| kept 16 | 5.00 | 50.00 | 1 |",
        "| lego 1.5s | 12.0 | 100 | 34.57 | 0.9876 | 25 | 0 |",
        "median: 30.0 ms",
    ] {
        assert!(report.contains(line), "no '{line}' in\n{report}");
    }
    assert!(!report.contains("missing"), "{report}");
    assert!(
        readme.starts_with("before\n") && readme.ends_with("after\n") && !readme.contains("old"),
        "{readme}"
    );
    let all = "34.57 / 34.57 / 34.57 / 34.57";
    assert!(
        readme.contains(&format!("| right | the same, bit for bit | 5.00 | {all} | {all} | 34.57 | 30.0 |")),
        "{readme}"
    );
    let names: Vec<_> = fs::read_dir(machine.folder.join("results")).expect("results").collect();
    assert_eq!(names.len(), 2, "the archive and the summary, nothing else");
}

#[test]
fn parts_that_fail_or_hang_do_not_stop_the_rest() {
    let machine = Machine::new("failing");
    let begin = Instant::now();
    let variables = [("FAIL", "step"), ("HANG", "train_lego_12s"), ("LIMIT", "2")];
    assert_eq!(machine.run(&variables), Some(2));
    assert!(begin.elapsed() < Duration::from_secs(300), "a part that hangs is ended");
    let (merged, report, readme) = machine.results();
    assert_eq!(
        (count(&merged, "done"), count(&merged, "failed"), count(&merged, "timeout")),
        (PARTS - 2, 1, 1)
    );
    assert!(
        report.contains("| lego 12s | missing | missing |") && report.contains("| step | failed |"),
        "{report}"
    );
    assert!(readme.contains("| missing | 34.57 / 34.57 / missing / 34.57 |"), "{readme}");
}

#[test]
fn wrong_kernels_are_in_the_exit_code() {
    for (wrong, told) in [
        ("own", "own path: wrong: hash grid: features"),
        ("fixed", "fixed: wrong: hash grid: features"),
        ("kernels", "36 passed, 1 failed grid::one_feature_by_hand"),
    ] {
        let machine = Machine::new(&format!("wrong_{wrong}"));
        let variables = [("WRONG", wrong), ("FAIL", "ceilings")];
        assert_eq!(machine.run(&variables), Some(1), "{wrong}");
        // Nobody listens.
        let (_, stderr) = std::io::pipe().expect("a pipe");
        let status = machine.script(&variables).stderr(stderr).status().expect("bash");
        assert_eq!(status.code(), Some(1), "{wrong}");
        let (merged, report, _) = machine.results();
        assert_eq!((count(&merged, "wrong"), count(&merged, "failed")), (1, 1), "{wrong}");
        assert!(report.contains(told), "{report}");
    }
}

#[test]
fn errors_are_not_taken_for_wrong_kernels_or_results() {
    for (variable, broken, line) in [
        (
            "DIVERGED",
            "train_lego_12s",
            "| train_lego_12s | failed | error: the run has no PSNR: it diverged |",
        ),
        ("BROKEN", "train_lego_12s", "| train_lego_12s | failed | the device was lost |"),
        ("BROKEN", "exchange", "| check_exchange | failed | the device was lost |"),
        ("BROKEN", "kernels", "| kernels | failed |"),
    ] {
        let machine = Machine::new(&format!("{variable}_{broken}"));
        assert_eq!(machine.run(&[(variable, broken)]), Some(2), "{broken}");
        let (merged, report, _) = machine.results();
        assert_eq!((count(&merged, "done"), count(&merged, "failed")), (PARTS - 1, 1), "{broken}");
        assert!(report.contains(line), "{report}");
    }
}

#[test]
fn parts_without_time_are_left_out_and_told() {
    let machine = Machine::new("short");
    assert_eq!(machine.run(&[("SECONDS_ALL", "60")]), Some(2));
    let (merged, report, _) = machine.results();
    assert!(count(&merged, "skipped") >= 2 && count(&merged, "done") > 10, "{report}");
    assert!(report.contains("| train_lego_60s | skipped |"), "{report}");
}

#[test]
fn odd_places_and_numbers() {
    let machine = Machine::new("a place with spaces");
    assert_eq!(machine.run(&[("NEEDS_LIBRARY", "1")]), Some(0), "the bundle's own loader is found");
    for (name, value) in [("SECONDS_ALL", "9m"), ("SECONDS_ALL", ""), ("LIMIT", "0"), ("LIMIT", "abc")] {
        let wanted = if value.is_empty() { 0 } else { 2 };
        assert_eq!(machine.run(&[(name, value)]), Some(wanted), "{name}={value}");
    }
    assert_eq!(machine.run(&[("SECONDS_ALL", "010")]), Some(2), "eight or more parts do not begin");
    let file = machine.folder.join("file");
    fs::write(&file, "").expect("writable");
    let mut command = std::process::Command::new(machine.folder.join("bundle/gpu.sh"));
    assert_eq!(command.arg(file).output().expect("bash").status.code(), Some(2));
}

/// A call that is told to stop leaves nothing of an earlier one, and nothing that runs.
#[test]
fn a_stopped_call_tells_so() {
    let machine = Machine::new("stopped");
    assert_eq!(machine.run(&[]), Some(0));
    let mut call = machine.script(&[("HANG", "adapters")]).stderr(Stdio::null()).spawn().expect("bash");
    let summary = machine.folder.join("results/summary.txt");
    let begin = Instant::now();
    while fs::read_to_string(&summary).is_ok_and(|text| text.contains("train_lego_60s")) {
        assert!(begin.elapsed() < Duration::from_secs(30), "the earlier summary is still there");
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_millis(500));
    Command::new("kill").args(["-TERM", &call.id().to_string()]).assert().success();
    let told = Instant::now();
    assert_eq!(call.wait().expect("ended").code(), Some(2));
    assert!(told.elapsed() < Duration::from_secs(15), "the part ended with it");
    assert!(fs::read_to_string(&summary).is_ok_and(|text| text.ends_with("stopped\n")));
    // Without its two lines the README is not written, and that is an error.
    let (page, _) = machine.page("", false);
    assert_eq!(count(&merged(&page), "missing"), PARTS);
}

#[test]
fn a_killed_call_leaves_what_was_known() {
    let machine = Machine::new("killed");
    let mut script = machine.script(&[("HANG", "render")]);
    let mut call = script.process_group(0).stderr(Stdio::null()).spawn().expect("bash");
    let summary = machine.folder.join("results/summary.txt");
    let begin = Instant::now();
    while !fs::read_to_string(&summary).is_ok_and(|text| text.contains("train_lego_60s")) {
        assert!(begin.elapsed() < Duration::from_secs(300), "the script did not get that far");
        std::thread::sleep(Duration::from_millis(50));
    }
    Command::new("kill").args(["-KILL", "--", &format!("-{}", call.id())]).assert().success();
    assert_eq!(call.wait().expect("ended").signal(), Some(9));
    let (merged, report, readme) = machine.results();
    assert_eq!((count(&merged, "done"), count(&merged, "missing")), (9, PARTS - 9), "{report}");
    assert!(report.contains("| render | missing |  | - |"), "{report}");
    assert!(readme.contains("missing / missing / missing / missing | missing | missing |"), "{readme}");
}
