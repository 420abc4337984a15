//! How fast photos are loaded, and in how much memory, from files to the first step of a training run.
//!
//! `cargo bench --bench loading -- [COUNTxWIDTHxHEIGHT …]` writes JPEGs to a temporary folder (below `TMPDIR`), and
//! loads each case in a process of its own, since a peak never falls. It prints a Markdown table; the peak is that of
//! the whole process (Linux only), the device's memory included where the adapter is a CPU.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use image::{ImageBuffer, ImageFormat, Rgb};
use nerf::capture::dataset::{Dataset, HoldOut, OpenOptions};
use nerf::config::Config;
use nerf::field::trainer::Trainer;
use nerf::field::{Field, Plan};
use nerf::gpu::{Gpu, adapter};
use nerf::photo::Reading;
use nerf::run::TrainingPhotos;
use nerf::run::memory::peak_bytes;
use nerf::support::format::bytes;
use rayon::prelude::*;

/// Measured if nothing is said.
const CASES: [Case; 6] = [
    Case { count: 1000, size: [480, 270] },
    Case { count: 100, size: [1920, 1080] },
    Case { count: 300, size: [1920, 1080] },
    Case { count: 1000, size: [1920, 1080] },
    Case { count: 100, size: [3840, 2160] },
    Case { count: 30, size: [6000, 4000] },
];
/// The environment variable that tells a child its folder and its number of photos.
const CHILD: &str = "NERF_LOADING_BENCH";

/// So many photos of one size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Case {
    count: usize,
    size: [u32; 2],
}

fn main() -> Result<()> {
    if let Ok(task) = std::env::var(CHILD) {
        let (folder, count) = task.rsplit_once('*').context("expected FOLDER*COUNT")?;
        return load(Path::new(folder), count.parse()?);
    }
    let asked: Vec<Case> = std::env::args().filter_map(|text| Case::parse(&text)).collect();
    let cases = if asked.is_empty() { CASES.to_vec() } else { asked };
    println!(
        "| photos | size | MB each | opened, s | loaded, s | photos/s | stated: host | stated: device | peak of the \
         process |\n| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    );
    let folder = tempfile::tempdir()?;
    for case in &cases {
        let [width, height] = case.size;
        let photos = folder.path().join(format!("{width}x{height}"));
        let most = cases.iter().filter(|other| other.size == case.size).map(|other| other.count).max();
        if !photos.exists() {
            std::fs::create_dir(&photos)?;
            write(&photos, most.unwrap_or(case.count) as u32, case.size)?;
        }
        let status = std::process::Command::new(std::env::current_exe()?)
            .env(CHILD, format!("{}*{}", photos.display(), case.count))
            .status()?;
        ensure!(status.success(), "loading {} photos of {width}x{height} failed", case.count);
    }
    Ok(())
}

impl Case {
    /// `COUNTxWIDTHxHEIGHT`.
    fn parse(text: &str) -> Option<Self> {
        let numbers: Vec<u32> = text.split('x').map(|part| part.parse().ok()).collect::<Option<_>>()?;
        let [count, width, height] = numbers[..] else { return None };
        Some(Self { count: count as usize, size: [width, height] })
    }
}

/// Loads the first `count` photos of a folder for a training run with the adapter's defaults, and takes a step.
fn load(folder: &Path, count: usize) -> Result<()> {
    let clock = Instant::now();
    let reading = Reading { max_images: Some(count), ..Reading::default() };
    let options = OpenOptions { hold_out: HoldOut::None, reading, ..OpenOptions::default() };
    let dataset = Dataset::open(folder, &options)?;
    let opened = clock.elapsed().as_secs_f64();
    let gpu = Arc::new(Gpu::open(&adapter::choose(None)?)?);
    let plan = Plan::for_dataset(&gpu, &dataset, Config::for_dataset(&dataset, gpu.is_cpu())?)?;
    let photos = TrainingPhotos::of(&dataset);
    let memory = photos.memory(&plan, &[], gpu.is_cpu());
    memory.check_device(&gpu, &plan)?;
    let clock = Instant::now();
    let views = photos.load(&gpu, &plan, &mut ())?;
    let loaded = clock.elapsed().as_secs_f64();
    let mut trainer = Trainer::new(Field::new(&gpu, plan)?, views)?;
    trainer.step(0.0, None)?;
    trainer.report()?;
    let sizes = dataset.train.iter().map(|&i| Ok(dataset.frames[i].path.metadata()?.len()));
    let megabytes = sizes.sum::<std::io::Result<u64>>()? as f64 / 1e6 / count as f64;
    let [width, height] = photos.cameras().first().map_or([0, 0], |camera| [camera.width, camera.height]);
    println!(
        "| {count} | {width}x{height} | {megabytes:.2} | {opened:.2} | {loaded:.1} | {:.1} | {} | {} | {} |",
        count as f64 / loaded,
        bytes(memory.host_bytes),
        bytes(memory.device_bytes),
        peak_bytes().map_or_else(|| "unknown".to_owned(), bytes),
    );
    Ok(())
}

/// Photos with shapes of all sizes and some grain.
fn write(folder: &Path, count: u32, [width, height]: [u32; 2]) -> Result<()> {
    let draw = |index: u32| -> Result<()> {
        let color = |x: u32, y: u32| {
            let (u, v) = (x as f32 / 97.0, (y + 40 * index) as f32 / 61.0);
            let wave = (u.sin() * v.cos() + (5.0 * u + v).sin() * 0.3) * 0.4 + 0.5;
            let grain = (x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b) ^ index)
                .wrapping_mul(0xc2b2_ae35)
                >> 28;
            let value = (wave.clamp(0.0, 1.0) * 230.0) as u8 + grain as u8;
            Rgb([value, 255 - value, value / 2 + 60])
        };
        let path = folder.join(format!("{index:04}.jpg"));
        Ok(ImageBuffer::from_fn(width, height, color).save_with_format(&path, ImageFormat::Jpeg)?)
    };
    (0..count).into_par_iter().try_for_each(draw)?;
    let frame = |index: u32| {
        let angle = f64::from(index) * 0.1;
        let (sin, cos) = angle.sin_cos();
        serde_json::json!({
            "file_path": format!("{index:04}.jpg"),
            "transform_matrix":
                [[cos, 0.0, sin, 4.0 * sin], [0.0, 1.0, 0.0, 0.0], [-sin, 0.0, cos, 4.0 * cos], [0.0, 0.0, 0.0, 1.0]],
        })
    };
    let listing =
        serde_json::json!({ "camera_angle_x": 0.9, "frames": (0..count).map(frame).collect::<Vec<_>>() });
    Ok(std::fs::write(folder.join("transforms.json"), listing.to_string())?)
}
