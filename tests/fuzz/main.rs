//! The reader of transforms.json under random damage: it never panics, is quick, and says little.
//!
//! `NERF_FUZZ_CASES=1000000 cargo test --test fuzz -- --nocapture damaged` runs longer than the few
//! thousand cases of an ordinary test run, prints how long it took, and looks at memory. Memory is that of the whole
//! process, so nothing else is tested in it.

mod damage;

use std::time::{Duration, Instant};

use damage::{cases, odd_values, seeds};
use nerf::capture::dataset::{Listing, transforms};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

/// Whatever is accepted can be used.
fn check_listing(listing: &Listing) -> Result<(), TestCaseError> {
    prop_assert!(!listing.frames.is_empty());
    for entry in &listing.frames {
        for size in [[64, 48], [1, 60_000]] {
            let camera = entry.intrinsics.camera(size, entry.world_from_camera).0;
            prop_assert!(camera.focal_px.is_finite() && camera.focal_px.min_element() > 0.0, "{camera:?}");
            prop_assert!(camera.center_px.is_finite() && camera.world_from_camera.is_finite(), "{camera:?}");
            let axes = camera.world_from_camera.matrix3;
            prop_assert!((axes.transpose() * axes).abs_diff_eq(glam::DMat3::IDENTITY, 1e-9), "{camera:?}");
        }
    }
    if let Some(scene_box) = listing.scene_box {
        prop_assert!(scene_box.scale.is_finite() && scene_box.scale > 0.0 && scene_box.offset.is_finite());
    }
    Ok(())
}

/// What a run has seen so far.
#[derive(Default)]
struct Tally {
    runs: usize,
    accepted: usize,
    /// The document that took longest, and how long.
    slowest: (Duration, Vec<u8>),
    /// Resident memory once everything has been used, MiB.
    warm: Option<usize>,
}

impl Tally {
    fn check(&mut self, bytes: Vec<u8>) -> Result<(), TestCaseError> {
        self.runs += 1;
        if self.runs == 1000 {
            self.warm = resident();
        }
        let (elapsed, result) = timed(&bytes);
        let said: usize = match &result {
            Ok(listing) => {
                self.accepted += 1;
                check_listing(listing)?;
                listing.notes().iter().map(|note| note.message.len()).sum()
            }
            Err(error) => format!("{error:#}").len(),
        };
        prop_assert!(said < 4096 + 2 * bytes.len(), "{said} bytes are said about {}", bytes.len());
        if elapsed > self.slowest.0 {
            self.slowest = (elapsed, bytes);
        }
        Ok(())
    }
}

fn timed(bytes: &[u8]) -> (Duration, anyhow::Result<Listing>) {
    let start = Instant::now();
    let result = transforms::parse_bytes(bytes);
    (start.elapsed(), result)
}

/// Resident memory in MiB, where the system tells.
fn resident() -> Option<usize> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<usize>().ok()? / 1024)
}

#[test]
fn damaged_files_are_refused_or_read() {
    let cases_wanted = std::env::var("NERF_FUZZ_CASES").ok().map_or(4000, |n| n.parse().expect("a number"));
    let config = Config { cases: cases_wanted, failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let (seeds, odd) = (seeds(), odd_values());
    for seed in &seeds {
        transforms::parse(&seed.to_string()).expect("the seeds are valid");
    }
    let tally = std::cell::RefCell::new(Tally::default());
    let start = Instant::now();
    let outcome = runner.run(&cases(), |case| tally.borrow_mut().check(case.bytes(&seeds, &odd)));
    let seconds = start.elapsed().as_secs_f64();
    let Tally { runs, accepted, slowest: (slowest, document), warm } = tally.into_inner();
    // A busy machine stops a test now and then: the same document, several times.
    let again = (0..5).map(|_| timed(&document).0).min().unwrap_or_default();
    eprintln!(
        "{runs} executions in {seconds:.1} s ({:.0}/s), {accepted} accepted; slowest {slowest:?}, again {again:?}, \
         {} bytes; resident {warm:?} to {:?} MiB",
        runs as f64 / seconds,
        document.len(),
        resident()
    );
    outcome.expect("no case fails");
    assert!(runs < 100 || (accepted > runs / 20 && accepted < runs / 20 * 19), "{accepted} of {runs}");
    assert!(again < Duration::from_millis(50), "{again:?} for {}", String::from_utf8_lossy(&document));
    // In a short run, the other test of this file may be what needs memory.
    if let Some((before, after)) = warm.zip(resident()).filter(|_| cases_wanted > 100_000) {
        assert!(after < before + 64, "memory grew from {before} to {after} MiB");
    }
}

/// A document whose frames each give cause to remarks with numbers of their own, and are in a list.
fn many_frames(count: u32) -> String {
    let mut frames = String::new();
    let mut names = String::new();
    for index in 0..count {
        let separator = if index == 0 { "" } else { "," };
        let (w, x) = (1000 + index % 977, f64::from(index) * 0.001);
        frames += &format!(
            "{separator}{{\"file_path\": \"images/{index:06}.png\", \"w\": {w}, \"h\": 800, \"fl_x\": {}, \
             \"camera_angle_x\": 0.5, \"transform_matrix\": [[2,0,0,{x}],[0,2,0,0],[0,0,2,1],[0,0,0,1]],}}\n",
            900 + index
        );
        names += &format!("{separator}\"C:\\\\data\\\\images\\\\{index:06}.jpg\"");
    }
    format!("{{\"train_filenames\": [{names}], \"frames\": [{frames}]}}")
}

#[test]
fn many_frames_take_time_in_proportion() {
    for count in [10_000, 100_000] {
        let text = many_frames(count);
        let (elapsed, listing) = timed(text.as_bytes());
        let listing = listing.expect("valid");
        eprintln!("{count} frames, {} MB: {elapsed:?}", text.len() / 1_000_000);
        assert_eq!(listing.frames.len(), count as usize);
        assert!(listing.frames.iter().all(|entry| entry.split.is_some()));
        assert_eq!(listing.notes().len(), 2, "{:?}", listing.notes());
        assert!(elapsed < Duration::from_secs(60), "{elapsed:?}");
    }
}
