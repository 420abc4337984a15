//! `nerf render`: a trained field seen from any cameras.

use super::{Session, writable_folder};
use crate::cli::{Format, PictureBackground, Render};
use crate::progress::Progress;
use anyhow::{Result, ensure};
use nerf::camera::Bounds;
use nerf::camera::{Camera, LensKind};
use nerf::capture::dataset::read_cameras;
use nerf::capture::image_file::{ExrPixels, Precision, write_exr, write_png_rgba8};
use nerf::field::renderer::{Renderer, View};
use nerf::photo::color_space::{ColorSpace, depth_srgb8, opaque_srgb8};
use nerf::run::TrainedField;
use nerf::support::file::write_json;
use nerf::support::format::count;
use serde_json::{Map, Value, json};
use std::panic::resume_unwind;
use std::sync::mpsc;
use std::thread;
use std::time::Instant;

/// A camera to render, and where it comes from.
struct Job {
    index: usize,
    source: String,
    camera: Camera,
}

/// Most pixels along a side of a rendered image.
const MOST_PIXELS: u32 = 16_384;

/// How rendered views become files.
struct Writer<'a> {
    args: &'a Render,
    color_space: ColorSpace,
    /// Depths that are white and black in depth pictures, in world units.
    depth_range: [f64; 2],
}

pub(super) fn run(args: &Render, session: &Session<'_>) -> Result<()> {
    let field = session.load_field(&args.run)?;
    let jobs = jobs(args, &field)?;
    writable_folder(&args.out)?;
    let gpu = session.open_gpu()?;
    let lenses = LensKind::among(jobs.iter().map(|job| &job.camera));
    let mut renderer = field.renderer(&gpu, &lenses)?;
    let depth_range = depth_range(&field.metadata().bounds, &jobs);
    let writer = Writer { args, color_space: field.color_space(), depth_range };
    let progress = Progress::new(session.console, "rendering");
    let (frames, seconds) = render_and_write(&mut renderer, &jobs, &writer, &progress)?;
    drop(progress);
    let mut listing =
        json!({ "checkpoint": field.path.display().to_string(), "step": field.metadata().step });
    if args.depth {
        listing["depth_near"] = json!(depth_range[0]);
        listing["depth_far"] = json!(depth_range[1]);
    }
    listing["frames"] = Value::Array(frames);
    write_json(&args.out.join("frames.json"), &listing)?;
    let out = args.out.display().to_string();
    let result = json!({ "out": out, "frames": jobs.len(), "seconds": seconds });
    session.print(&result, &format!("{} in {out}", count(jobs.len(), "frame")))
}

/// Renders the jobs in order, describes their files, and returns the seconds that each took to render. A thread writes those
/// of one view while the next one renders.
fn render_and_write(
    renderer: &mut Renderer,
    jobs: &[Job],
    writer: &Writer<'_>,
    progress: &Progress,
) -> Result<(Vec<Value>, Vec<f64>)> {
    thread::scope(|scope| {
        // Without room in between: the next view waits until the last one is written.
        let (sender, views) = mpsc::sync_channel::<(&Job, View)>(0);
        let writing = scope.spawn(move || views.iter().map(|(job, view)| writer.write(job, &view)).collect());
        let mut render = || -> Result<Vec<f64>> {
            let mut seconds = Vec::with_capacity(jobs.len());
            for (number, job) in jobs.iter().enumerate() {
                let clock = Instant::now();
                let view = renderer.render(&job.camera)?;
                seconds.push(clock.elapsed().as_secs_f64());
                // Nobody receives it where writing failed, which is reported below.
                if sender.send((job, view)).is_err() {
                    break;
                }
                progress.count(number + 1, jobs.len(), "frames");
            }
            Ok(seconds)
        };
        let rendered = render();
        drop(sender);
        let written: Result<Vec<Value>> = writing.join().unwrap_or_else(|panic| resume_unwind(panic));
        let frames = written?;
        rendered.map(|seconds| (frames, seconds))
    })
}

fn jobs(args: &Render, field: &TrainedField) -> Result<Vec<Job>> {
    let metadata = field.metadata();
    let [width, height] = metadata.image_size;
    let cameras: Vec<(String, Camera)> = match (&args.path.cameras, args.path.orbit) {
        (Some(file), _) => {
            let default_size = [args.width, args.height].into_iter().collect::<Option<Vec<_>>>();
            let default_size = default_size.map_or([width, height], |size| [size[0], size[1]]);
            read_cameras(file, default_size)?
        }
        (None, count) => {
            let cameras = metadata.orbit.cameras(metadata.bounds.center, count.unwrap_or(1) as usize);
            let named = cameras.into_iter().enumerate();
            named.map(|(index, camera)| (format!("orbit {index}"), camera)).collect()
        }
    };
    let (first, end) = args.frames.unwrap_or((0, cameras.len()));
    ensure!(
        end <= cameras.len() && first < end,
        "--frames expects a range within 0..{}, found {first}..{end}",
        cameras.len()
    );
    let job = |(index, (source, camera)): (usize, (String, Camera))| {
        let camera = resized(camera, args.width, args.height);
        Job { index, source, camera }
    };
    let jobs: Vec<Job> = cameras.into_iter().enumerate().take(end).skip(first).map(job).collect();
    for Job { source, camera, .. } in &jobs {
        ensure!(
            camera.width.max(camera.height) <= MOST_PIXELS,
            "the camera of {source} has {}x{} pixels, and at most {MOST_PIXELS} a side are rendered; say --width",
            camera.width,
            camera.height
        );
    }
    Ok(jobs)
}

/// The camera at the size asked for; a side that is not given follows.
fn resized(camera: Camera, width: Option<u32>, height: Option<u32>) -> Camera {
    let follow = |side: u32, other: u32, other_was: u32| {
        (f64::from(side) * f64::from(other) / f64::from(other_was)).round().max(1.0) as u32
    };
    match (width, height) {
        (None, None) => camera,
        (Some(width), Some(height)) => camera.resized(width, height),
        (Some(width), None) => camera.resized(width, follow(camera.height, width, camera.width)),
        (None, Some(height)) => camera.resized(follow(camera.width, height, camera.height), height),
    }
}

/// The same for all frames, so that a film does not flicker: the inner cube as the cameras see it.
fn depth_range(bounds: &Bounds, jobs: &[Job]) -> [f64; 2] {
    let reach = 3f64.sqrt() * bounds.half;
    let distances = jobs.iter().map(|job| job.camera.position().distance(bounds.center));
    let (nearest, farthest) =
        distances.fold((f64::INFINITY, 0.0f64), |(near, far), d| (near.min(d), far.max(d)));
    [(nearest - reach).max(0.0), farthest + reach]
}

impl Writer<'_> {
    /// Writes the files of a view and describes them.
    fn write(&self, job: &Job, view: &View) -> Result<Value> {
        let (stem, args) = (format!("{:04}", job.index), self.args);
        let mut files = Map::new();
        if args.format.contains(&Format::Png) {
            let pixels = match args.background {
                PictureBackground::Transparent => self.color_space.straight_srgb8(&view.color),
                PictureBackground::Color(color) => opaque_srgb8(&self.color_space.over(&view.color, color)),
            };
            files.insert("png".to_owned(), self.write_png(format!("{stem}.png"), view, &pixels)?);
        }
        if args.format.contains(&Format::Exr) {
            let file = format!("{stem}.exr");
            let color = self.color_space.linear(&view.color);
            let pixels = ExrPixels { color: &color, depth: Some(&view.depth) };
            let precision = if args.half { Precision::Half } else { Precision::Float };
            write_exr(&args.out.join(&file), view.width, view.height, &pixels, precision)?;
            files.insert("exr".to_owned(), json!(file));
        }
        if args.depth {
            let pixels = depth_srgb8(&view.depth, &view.color, self.depth_range.map(|z| z as f32));
            files.insert("depth".to_owned(), self.write_png(format!("{stem}_depth.png"), view, &pixels)?);
        }
        Ok(json!({
            "index": job.index,
            "source": job.source,
            "width": view.width,
            "height": view.height,
            "files": files,
        }))
    }

    fn write_png(&self, file: String, view: &View, pixels: &[[u8; 4]]) -> Result<Value> {
        write_png_rgba8(&self.args.out.join(&file), view.width, view.height, pixels)?;
        Ok(Value::String(file))
    }
}
