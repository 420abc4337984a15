//! Writes a generated dataset: the images of each split, then its `transforms_*.json`.

use super::picture::{RenderedImage, render};
use super::rig::{ORBIT_FOV_RAD, SPLITS, camera, view_count};
use super::{Scene, SceneOptions, Summary};
use crate::camera::{Camera, Lens, LensKind};
use crate::capture::image_file::{ExrPixels, Precision, write_exr, write_png_rgba8};
use crate::photo::Split;
use crate::support::file::write_json;
use crate::support::lock::{FolderLock, is_used};
use anyhow::{Context, Result, bail};
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// The file that is there until the dataset is whole: what is beside it is not.
const UNFINISHED: &str = ".nerf-unfinished";

/// See [`super::generate`].
pub(super) fn write(
    scene: &Scene,
    options: &SceneOptions,
    out: &Path,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Summary> {
    let _lock = claim(out)?;
    let views: Vec<GeneratedView> = SPLITS
        .into_iter()
        .flat_map(|split| (0..view_count(options, split)).map(move |index| (split, index)))
        .map(|(split, index)| GeneratedView { split, index, camera: camera(scene, options, split, index) })
        .collect();
    let list = || {
        // Without that of the training views, which comes last, it is no dataset.
        for split in SPLITS.into_iter().rev() {
            let frames = views.iter().filter(|view| view.split == split);
            write_json(&listing_path(out, split), &listing(scene, options, frames))?;
        }
        fs::remove_file(out.join(UNFINISHED)).with_context(|| format!("finishing {}", out.display()))
    };
    let written = write_views(scene, options, &views, out, progress).and_then(|()| list());
    if written.is_err() {
        clear(out);
    }
    written?;
    let files = 2 * views.len() + SPLITS.len();
    Ok(Summary { scene: scene.info().name, views: views.len(), files })
}

/// Writes the pictures.
fn write_views(
    scene: &Scene,
    options: &SceneOptions,
    views: &[GeneratedView],
    out: &Path,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<()> {
    for split in SPLITS {
        let folder = out.join(split.name());
        fs::create_dir_all(&folder).with_context(|| format!("creating {}", folder.display()))?;
    }
    let done = AtomicUsize::new(0);
    views.par_iter().try_for_each(|view| {
        options.interrupt.check()?;
        let picture = render(scene, &view.camera, options.samples);
        view.write(&picture, options.hdr, out)?;
        progress(done.fetch_add(1, Ordering::Relaxed) + 1);
        anyhow::Ok(())
    })
}

/// Creates the folder `out`, or accepts it where it is empty, or where a process that wrote to it was killed; nobody else
/// writes to it meanwhile.
fn claim(out: &Path) -> Result<FolderLock> {
    is_used(out)?;
    let lock = FolderLock::alone(out)?;
    if out.join(UNFINISHED).exists() {
        clear(out);
    }
    if is_used(out)? {
        bail!("{} is not empty; name a new or empty folder, or remove it first", out.display());
    }
    fs::File::create(out.join(UNFINISHED)).with_context(|| format!("writing to {}", out.display()))?;
    Ok(lock)
}

/// Removes what was written of a dataset to a folder that was empty. What cannot be removed does no harm: there is no list of
/// it.
fn clear(out: &Path) {
    for split in SPLITS {
        let _ = fs::remove_file(listing_path(out, split));
        let _ = fs::remove_dir_all(out.join(split.name()));
    }
    let _ = fs::remove_file(out.join(UNFINISHED));
}

fn listing_path(out: &Path, split: Split) -> PathBuf {
    out.join(format!("transforms_{}.json", split.name()))
}

/// One picture of the dataset.
struct GeneratedView {
    split: Split,
    index: usize,
    camera: Camera,
}

impl GeneratedView {
    /// The path of its files within the dataset, without extension.
    fn stem(&self) -> String {
        format!("{}/{:04}", self.split.name(), self.index)
    }

    fn depth_path(&self) -> String {
        format!("{}_depth.exr", self.stem())
    }

    fn write(&self, picture: &RenderedImage, hdr: bool, out: &Path) -> Result<()> {
        let (width, height) = (self.camera.width, self.camera.height);
        let color = &picture.linear[..];
        let depth = ExrPixels { color, depth: Some(&picture.depth) };
        write_exr(&out.join(self.depth_path()), width, height, &depth, Precision::Float)?;
        if hdr {
            let path = out.join(format!("{}.exr", self.stem()));
            let image = ExrPixels { color, depth: None };
            write_exr(&path, width, height, &image, Precision::Float)
        } else {
            write_png_rgba8(&out.join(format!("{}.png", self.stem())), width, height, &picture.srgb)
        }
    }

    /// Its entry in `transforms_*.json`; `extension` is that of the image, with its dot.
    fn entry(&self, extension: &str) -> Map<String, Value> {
        let pose = self.camera.world_from_camera;
        let rows = [0, 1, 2].map(|row| {
            let axes = pose.matrix3.row(row);
            [axes.x, axes.y, axes.z, pose.translation[row]]
        });
        Map::from_iter([
            ("file_path".to_owned(), json!(format!("./{}{extension}", self.stem()))),
            ("depth_file_path".to_owned(), json!(format!("./{}", self.depth_path()))),
            ("transform_matrix".to_owned(), json!([rows[0], rows[1], rows[2], [0.0, 0.0, 0.0, 1.0]])),
        ])
    }
}

/// The contents of a `transforms_*.json`: in Blender's dialect (`camera_angle_x`, 8-bit images named without
/// extension) for scenes with alpha seen by pinholes, else with full intrinsics, of every frame where they differ.
fn listing<'a>(
    scene: &Scene,
    options: &SceneOptions,
    views: impl Iterator<Item = &'a GeneratedView>,
) -> Value {
    let is_blender = !scene.is_opaque() && options.lenses.iter().all(|&kind| kind == LensKind::Pinhole);
    let extension = match (options.hdr, is_blender) {
        (true, _) => ".exr",
        (false, false) => ".png",
        (false, true) => "",
    };
    let is_mixed = options.lenses.len() > 1;
    let mut listing = Map::new();
    let mut frames = Vec::new();
    for view in views {
        let mut entry = view.entry(extension);
        if is_mixed {
            entry.extend(intrinsics(&view.camera));
        } else if listing.is_empty() && !is_blender {
            listing.extend(intrinsics(&view.camera));
        }
        frames.push(Value::Object(entry));
    }
    if is_blender || frames.is_empty() {
        let (width, height) = options.size;
        listing.insert("camera_angle_x".to_owned(), json!(ORBIT_FOV_RAD));
        listing.insert("w".to_owned(), json!(width));
        listing.insert("h".to_owned(), json!(height));
    }
    listing.insert("frames".to_owned(), Value::Array(frames));
    Value::Object(listing)
}

/// A camera's size, focal lengths, principal point and lens, in pixels, as capture tools name them.
fn intrinsics(camera: &Camera) -> Map<String, Value> {
    let mut keys = Map::new();
    let mut put = |name: &str, value: Value| keys.insert(name.to_owned(), value);
    let (model, coefficients) = match camera.lens {
        Lens::Pinhole => ("PINHOLE", Vec::new()),
        Lens::OpenCv { k, p } => ("OPENCV", [&k[..], &p[..]].concat()),
        Lens::Fisheye { k } => ("OPENCV_FISHEYE", k.to_vec()),
        Lens::Orthographic => ("ORTHOGRAPHIC", Vec::new()),
        Lens::Equirectangular => ("EQUIRECTANGULAR", Vec::new()),
    };
    put("camera_model", json!(model));
    put("w", json!(camera.width));
    put("h", json!(camera.height));
    put("fl_x", json!(camera.focal_px.x));
    put("fl_y", json!(camera.focal_px.y));
    put("cx", json!(camera.center_px.x));
    put("cy", json!(camera.center_px.y));
    for (name, value) in ["k1", "k2", "k3", "k4", "p1", "p2"].into_iter().zip(coefficients) {
        put(name, json!(value));
    }
    keys
}
