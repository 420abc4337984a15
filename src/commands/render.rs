//! `nerf render`: a trained field seen from any cameras.

mod frame_folder;
mod frames;
mod framing;
mod writer;

use super::Session;
use crate::cli::{Format, PictureBackground, Render};
use crate::progress::Progress;
use anyhow::{Result, ensure};
use frame_folder::{Earlier, FrameFolder};
use frames::{Timing, render_and_write};
use framing::{framed, samples};
use nerf::camera::orbit::Orbit;
use nerf::camera::{Bounds, Camera, LensKind};
use nerf::capture::dataset::{UsualView, read_cameras, with_extensions};
use nerf::run::TrainedField;
use nerf::support::file::{available_bytes, first_within};
use nerf::support::fingerprint::checksum;
use nerf::support::format::{bytes, count, plural};
use serde_json::{Map, Value, json};
use std::path::Path;
use writer::Writer;

/// A camera to render, and where it comes from.
struct Job {
    index: usize,
    source: String,
    camera: Camera,
    /// Samples per pixel.
    samples: u32,
}

/// Most pixels along a side of a rendered image.
const MOST_PIXELS: u32 = 16_384;

pub(super) fn run(args: &Render, session: &Session<'_>) -> Result<()> {
    let field = session.load_field(&args.run)?;
    let mut jobs = jobs(args, &field)?;
    let range = depth_range(&field.metadata().bounds, &jobs);
    let rendering = rendering(args, &field, &jobs, range);
    select(args, &mut jobs)?;
    apart_from_photos(args, &jobs)?;
    let (folder, kept) = FrameFolder::take(&args.out, rendering, earlier(args))?;
    if folder.is_unguarded() {
        let out = args.out.display();
        session.console.warn(&format!(
            "the file system of {out} has no locks: let only one process at a time render to it"
        ));
    }
    let is_ours = |index| kept.contains(&index) || jobs.iter().any(|job| job.index as u64 == index);
    let strangers = if args.overwrite { folder.strangers(is_ours) } else { 0 };
    if strangers > 0 {
        session.console.warn(&format!(
            "{} in {} {} named like frames but not of this rendering; remove what does not belong there, or render to \
             another folder",
            count(strangers, "picture"),
            args.out.display(),
            plural(strangers as u64, "is", "are")
        ));
    }
    let all = jobs.len();
    jobs.retain(|job| args.overwrite || !kept.contains(&(job.index as u64)));
    let mut timing = Timing::default();
    if !jobs.is_empty() {
        warn_of_full_disk(args, &jobs, session);
        let gpu = session.open_gpu()?;
        let lenses = LensKind::among(jobs.iter().map(|job| &job.camera));
        let mut renderer = field.renderer(&gpu, &lenses)?;
        let writer = Writer::new(args, field.color_space(), range, folder);
        say_samples(args, &jobs, session);
        let progress = Progress::new(session.console, "rendering");
        session.end_gracefully()?;
        timing = render_and_write(&mut renderer, &jobs, &writer, &progress)?;
    }
    let (out, skipped) = (args.out.display().to_string(), all - jobs.len());
    let mut result = json!({ "out": out, "frames": jobs.len(), "skipped": skipped });
    timing.tell(&mut result);
    let were_there = if skipped > 0 { format!(", {skipped} were there already") } else { String::new() };
    session.print(&result, &format!("{} in {out}{were_there}", count(jobs.len(), "frame")))
}

fn earlier(args: &Render) -> Earlier {
    match (args.overwrite, args.skip_existing) {
        (true, _) => Earlier::Replaced,
        (_, true) => Earlier::Kept,
        _ => Earlier::Refused,
    }
}

/// What all frames of a path have in common, whichever of them are rendered.
fn rendering(args: &Render, field: &TrainedField, path: &[Job], depth_range: [f64; 2]) -> Map<String, Value> {
    let mut listing = Map::new();
    let mut set = |key: &str, value: Value| listing.insert(key.to_owned(), value);
    set("checkpoint", json!(field.path().display().to_string()));
    set("step", json!(field.metadata().step));
    if args.depth {
        set("depth_near", json!(depth_range[0]));
        set("depth_far", json!(depth_range[1]));
    }
    set("field", json!(field.identity()));
    set("cameras", json!(checksum(path.iter().map(|job| format!("{:?}", job.camera)))));
    let has = |format| args.format.contains(&format);
    let background = match args.background {
        PictureBackground::Transparent => json!("transparent"),
        PictureBackground::Color(color) => json!(color),
    };
    let settings = json!({
        "png": has(Format::Png),
        "exr": has(Format::Exr),
        "half": args.half,
        "depth": args.depth,
        "background": background,
        "spp": args.spp,
        "far_depth": args.far_depth.map(|depth| depth.to_string()),
    });
    set("settings", settings);
    listing
}

/// Warns where the frames may not fit on the disk; how well they compress is not known.
fn warn_of_full_disk(args: &Render, jobs: &[Job], session: &Session<'_>) {
    let has = |format| u64::from(args.format.contains(&format));
    let exr = if args.half { 12 } else { 20 };
    let per_pixel = 4 * has(Format::Png) + exr * has(Format::Exr) + 4 * u64::from(args.depth);
    let pixels: u64 = jobs.iter().map(|job| u64::from(job.camera.width) * u64::from(job.camera.height)).sum();
    if let Some(available) = available_bytes(&args.out).filter(|&available| available < pixels * per_pixel) {
        session.console.warn(&format!(
            "the frames take up to {}, and the file system of {} has {} left; should that not do, make room and go on \
             with --skip-existing",
            bytes(pixels * per_pixel),
            args.out.display(),
            bytes(available)
        ));
    }
}

/// Says where several samples per pixel are taken unasked.
fn say_samples(args: &Render, jobs: &[Job], session: &Session<'_>) {
    let most = jobs.iter().map(|job| job.samples).max().unwrap_or(1);
    if args.spp.is_none() && most > 1 {
        session.console.say(&format!(
            "{most} samples per pixel, since the pixels are coarser than those of the training photos; --spp 1 takes one"
        ));
    }
}

/// All cameras of the path.
fn jobs(args: &Render, field: &TrainedField) -> Result<Vec<Job>> {
    let metadata = field.metadata();
    let cameras: Vec<(String, Camera)> = match (&args.path.cameras, args.path.orbit) {
        (Some(file), _) => {
            let Orbit { width, focal_px, .. } = metadata.orbit;
            let size = metadata.image_size;
            let focal_px = focal_px * f64::from(size[0]) / f64::from(width);
            read_cameras(file, UsualView { size, focal_px })?
        }
        (None, count) => {
            let cameras = metadata.orbit.cameras(metadata.bounds.center, count.unwrap_or(1) as usize);
            let named = cameras.into_iter().enumerate();
            named.map(|(index, camera)| (format!("orbit {index}"), camera)).collect()
        }
    };
    let job = |(index, (source, camera)): (usize, (String, Camera))| {
        let camera = framed(camera, args)?;
        let samples = samples(&camera, metadata, args);
        Ok(Job { index, source, camera, samples })
    };
    cameras.into_iter().enumerate().map(job).collect()
}

/// Leaves the frames that are to be rendered.
fn select(args: &Render, jobs: &mut Vec<Job>) -> Result<()> {
    let (first, end) = args.frames.unwrap_or((0, jobs.len()));
    ensure!(
        end <= jobs.len() && first < end,
        "--frames expects a range within 0..{}, found {first}..{end}",
        jobs.len()
    );
    jobs.truncate(end);
    jobs.drain(..first);
    for Job { source, camera, .. } in jobs {
        ensure!(
            camera.width.max(camera.height) <= MOST_PIXELS,
            "the camera of {source} has {}x{} pixels, and at most {MOST_PIXELS} a side are rendered; say --width",
            camera.width,
            camera.height
        );
    }
    Ok(())
}

/// Frames must not lie among the photos that the cameras took, which have such names.
fn apart_from_photos(args: &Render, jobs: &[Job]) -> Result<()> {
    let Some(file) = &args.path.cameras else { return Ok(()) };
    let folder = file.parent().unwrap_or(Path::new(""));
    let photos = jobs.iter().flat_map(|job| with_extensions(&folder.join(&job.source)));
    let found = first_within(&args.out, photos);
    ensure!(
        found.is_none(),
        "the folder {} holds photos of the cameras ({}), which frames could replace; name another folder",
        args.out.display(),
        found.unwrap_or_default().display()
    );
    Ok(())
}

/// The same for all frames, so that a film does not flicker: the inner cube as the cameras see it.
fn depth_range(bounds: &Bounds, jobs: &[Job]) -> [f64; 2] {
    let reach = 3f64.sqrt() * bounds.half;
    let distances = jobs.iter().map(|job| job.camera.position().distance(bounds.center));
    let (nearest, farthest) =
        distances.fold((f64::INFINITY, 0.0f64), |(near, far), d| (near.min(d), far.max(d)));
    [(nearest - reach).max(0.0), farthest + reach]
}
