//! How fast photos are decoded, and how much memory that takes.
//!
//! Writes JPEGs to a temporary folder and streams them as a training does, once for each number of threads:
//! `cargo bench --bench loading -- [COUNT] [WIDTH] [HEIGHT]`, 200 of 1920x1080 if nothing is said. The peak is
//! that of the process (Linux only), which does nothing else.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result};
use image::{ImageBuffer, ImageFormat, Rgb};
use nerf::dataset::{Dataset, HoldOut, OpenOptions};
use rayon::prelude::*;

fn main() -> Result<()> {
    let numbers: Vec<u32> = std::env::args().filter_map(|argument| argument.parse().ok()).collect();
    let number = |place: usize, otherwise: u32| numbers.get(place).copied().unwrap_or(otherwise);
    let (count, size) = (number(0, 200), [number(1, 1920), number(2, 1080)]);
    if let Ok(folder) = std::env::var("NERF_LOADING_BENCH") {
        return load(Path::new(&folder));
    }
    let folder = tempfile::tempdir()?;
    let bytes = write(folder.path(), count, size)?;
    println!("{count} JPEGs of {}x{}, {:.2} MB each on average", size[0], size[1], bytes as f64 / 1e6);
    // Each in a process of its own: a peak never falls.
    let threads = std::thread::available_parallelism()?.get();
    for threads in (0..).map(|power| 1 << power).take_while(|&count| count <= threads) {
        let status = std::process::Command::new(std::env::current_exe()?)
            .env("NERF_LOADING_BENCH", folder.path())
            .env("RAYON_NUM_THREADS", threads.to_string())
            .status()?;
        anyhow::ensure!(status.success(), "loading failed");
    }
    Ok(())
}

fn load(folder: &Path) -> Result<()> {
    let clock = Instant::now();
    let dataset = Dataset::open(folder, &OpenOptions { hold_out: HoldOut::None, ..OpenOptions::default() })?;
    let opened = clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    let mut sum = 0;
    dataset.stream(&dataset.train, false, &mut |_, photo| {
        sum += u64::from(photo.image.width);
        Ok(())
    })?;
    let seconds = clock.elapsed().as_secs_f64();
    let count = dataset.train.len() as f64;
    println!(
        "{} threads: opened in {opened:.2} s, {:.1} images/s ({:.0} ms each); stated {} MB, peak of the process {}",
        rayon::current_num_threads(),
        count / seconds,
        1e3 * seconds / count,
        dataset.stream_bytes(&dataset.train) / 1_000_000,
        peak().unwrap_or_else(|| "unknown".to_owned()),
    );
    assert!(sum > 0);
    Ok(())
}

/// The most memory that this process has had in use.
fn peak() -> Option<String> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: f64 = line.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(format!("{:.0} MB", kilobytes * 1.024e-3))
}

/// Photos with shapes of all sizes and some grain; their mean number of bytes.
fn write(folder: &Path, count: u32, [width, height]: [u32; 2]) -> Result<u64> {
    let draw = |index: u32| -> Result<u64> {
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
        ImageBuffer::from_fn(width, height, color).save_with_format(&path, ImageFormat::Jpeg)?;
        Ok(path.metadata()?.len())
    };
    let bytes: Vec<u64> = (0..count).into_par_iter().map(draw).collect::<Result<_>>()?;
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
    std::fs::write(folder.join("transforms.json"), listing.to_string())?;
    bytes.iter().sum::<u64>().checked_div(u64::from(count)).context("expected at least one image")
}
