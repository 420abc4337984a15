//! Opening a dataset: find its files, parse them, look for the images, split, and bound the scene.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use rayon::prelude::*;

use super::bounds::{Bounds, Surroundings};
use super::notes::{Notes, Severity};
use super::transforms::{self, Entry, Listing};
use super::{Dataset, Frame, HoldOut, OpenOptions, Split, frames, splits};
use crate::camera::Camera;
use crate::image::{Header, Image};

/// A listed frame and what was found of it.
struct Located {
    entry: Entry,
    found: Option<(PathBuf, Header)>,
}

impl Dataset {
    /// Opens a folder or a single .json file without decoding the images.
    pub fn open(path: &Path, options: &OpenOptions) -> Result<Self> {
        if let HoldOut::Every(every) = options.hold_out {
            ensure!(every >= 2, "cannot hold out one frame in {every}: expected 2 or more, or none at all");
        }
        let mut notes = Notes::default();
        let sources = sources(path, &mut notes)?;
        let root = folder_of(&sources[0].1);
        let mut located = Vec::new();
        let mut scene_box = None;
        let mut dialect = "";
        for (split, source) in &sources {
            let listing = read(source)?;
            let is_first = located.is_empty();
            if is_first {
                dialect = listing.dialect;
            }
            // The training file speaks for the scene.
            scene_box = scene_box.or(listing.scene_box);
            located.extend(locate(listing, *split, &root, &mut notes)?);
        }
        let (listed, missing, located) = keep_present(located, &root, options, &mut notes)?;
        let is_hdr = check_dynamic_range(&located)?;
        let (frames, members) = build(located, &mut notes);
        let members: Vec<_> = members.iter().map(|(s, path)| (*s, path.as_path())).collect();
        let splits = splits::assign(&members, options.hold_out, &mut notes);
        let used = if splits.train.is_empty() { (0..frames.len()).collect() } else { splits.train.clone() };
        let surroundings = surroundings(&frames, used[0], missing.len() < listed)?;
        let cameras: Vec<&Camera> = used.iter().map(|&i| &frames[i].camera).collect();
        let bounds = Bounds::choose(&cameras, scene_box, surroundings, &mut notes);
        Ok(Self {
            root,
            dialect: dialect.to_owned(),
            frames,
            train: splits.train,
            val: splits.val,
            test: splits.test,
            listed,
            missing,
            is_hdr,
            is_cutout: surroundings == Surroundings::Empty,
            notes: notes.finish(),
            bounds,
        })
    }
}

/// Reads the cameras of a single file, in its order, without looking for images: name and camera. Sizes
/// come from the file, else `default_size` in pixels.
pub fn read_cameras(path: &Path, default_size: [u32; 2]) -> Result<Vec<(String, Camera)>> {
    let camera = |entry: Entry| {
        let size = declared_size(&entry).unwrap_or(default_size);
        let camera = entry.intrinsics.camera(size, entry.world_from_camera).0;
        (entry.file_path, camera)
    };
    Ok(read(path)?.frames.into_iter().map(camera).collect())
}

/// The files to read, training first, each with the split it stands for.
fn sources(path: &Path, notes: &mut Notes) -> Result<Vec<(Option<Split>, PathBuf)>> {
    if path.is_file() {
        let split = match path.file_name().and_then(|name| name.to_str()) {
            Some("transforms_val.json") => Some(Split::Val),
            Some("transforms_test.json") => Some(Split::Test),
            _ => None,
        };
        return Ok(vec![(split, path.to_owned())]);
    }
    ensure!(
        path.is_dir(),
        "{} does not exist; expected a folder with a transforms.json, or a .json file",
        path.display()
    );
    let present = |name: &str| Some(path.join(name)).filter(|path| path.is_file());
    let split_files: Vec<_> = [Split::Train, Split::Val, Split::Test]
        .into_iter()
        .zip(["train", "val", "test"])
        .filter_map(|(s, name)| Some((Some(s), present(&format!("transforms_{name}.json"))?)))
        .collect();
    let single = present("transforms.json");
    let has_train = split_files.first().is_some_and(|file| file.0 == Some(Split::Train));
    match (single, has_train) {
        (Some(_), true) => {
            notes.note("transforms.json is ignored, because there is a transforms_train.json");
            Ok(split_files)
        }
        (Some(single), false) if split_files.is_empty() => Ok(vec![(None, single)]),
        (Some(single), false) => {
            let train = std::iter::once((Some(Split::Train), single));
            Ok(train.chain(split_files).collect())
        }
        (None, _) if !split_files.is_empty() => Ok(split_files),
        (None, _) => bail!(
            "expected transforms.json or transforms_train.json in {}, found {}",
            path.display(),
            json_files(path)
        ),
    }
}

fn json_files(folder: &Path) -> String {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    let mut names: Vec<_> = names.filter(|name| name.ends_with(".json")).collect();
    names.sort();
    match names.len() {
        0 => "no .json file; convert your photos with COLMAP and one of its exporters".into(),
        _ => format!("{}; name the file itself", names.join(", ")),
    }
}

fn folder_of(file: &Path) -> PathBuf {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

fn read(path: &Path) -> Result<Listing> {
    let read = || transforms::parse_bytes(&std::fs::read(path)?);
    read().with_context(|| format!("reading {}", path.display()))
}

/// Looks for the images of one listing, in natural order of their names.
fn locate(
    mut listing: Listing,
    split: Option<Split>,
    root: &Path,
    notes: &mut Notes,
) -> Result<Vec<Located>> {
    notes.append(listing.notes);
    if listing.frames.iter().any(|entry| entry.split.is_some()) {
        listing.frames.retain(|entry| entry.split.is_some());
    }
    listing.frames.sort_by(|a, b| frames::natural_order(&a.file_path, &b.file_path));
    let mut seen = HashSet::new();
    let mut paths = Vec::new();
    for mut entry in listing.frames {
        entry.split = split.or(entry.split);
        let path = frames::find(root, &entry.file_path, &entry.label, notes);
        let identity = path.as_deref().map(canonical);
        if identity.is_some_and(|identity| !seen.insert(identity)) {
            let message = "the image is listed more than once; the first entry counts";
            notes.frame(Severity::Warning, &entry.label, message);
        } else {
            paths.push((entry, path));
        }
    }
    let inspect = |(entry, path): (Entry, Option<PathBuf>)| {
        let header = path.as_deref().map(Header::read).transpose();
        let header = header.with_context(|| entry.label.clone())?;
        Ok(Located { entry, found: path.zip(header) })
    };
    paths.into_par_iter().map(inspect).collect()
}

fn canonical(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// Sets missing frames aside: the number listed, the names missing, and the frames to go on with.
fn keep_present(
    located: Vec<Located>,
    root: &Path,
    options: &OpenOptions,
    notes: &mut Notes,
) -> Result<(usize, Vec<String>, Vec<Located>)> {
    let listed = located.len();
    let absent = located.iter().filter(|frame| frame.found.is_none());
    let missing: Vec<String> = absent.map(|frame| frame.entry.file_path.clone()).collect();
    if missing.is_empty() {
        return Ok((listed, missing, located));
    }
    let first: Vec<_> = missing.iter().take(3).map(String::as_str).collect();
    let more = if missing.len() > 3 { ", …" } else { "" };
    let message = format!(
        "{} of {listed} listed images are missing in {}: {}{more}",
        missing.len(),
        root.display(),
        first.join(", ")
    );
    if missing.len() < listed {
        notes.warn(format!("{message}; they are skipped"));
        let present = located.into_iter().filter(|frame| frame.found.is_some());
        return Ok((listed, missing, present.collect()));
    }
    ensure!(
        options.allow_missing,
        "{message}; put the images where `file_path` says, as PNG, JPEG or OpenEXR"
    );
    notes.warn(message);
    Ok((listed, missing, located))
}

fn check_dynamic_range(located: &[Located]) -> Result<bool> {
    let first_of = |hdr: bool| {
        let mut found = located.iter().filter_map(|frame| frame.found.as_ref());
        found.find(|(_, header)| header.is_hdr == hdr)
    };
    match (first_of(true), first_of(false)) {
        (Some((hdr, _)), Some((ldr, _))) => bail!(
            "expected all images in OpenEXR or none, found {} beside {}; convert one kind",
            hdr.display(),
            ldr.display()
        ),
        (hdr, _) => Ok(hdr.is_some()),
    }
}

/// Cameras at the size of their images, and what the splits need to know.
fn build(located: Vec<Located>, notes: &mut Notes) -> (Vec<Frame>, Vec<(Option<Split>, PathBuf)>) {
    let mut members = Vec::new();
    let mut frames = Vec::new();
    for Located { entry, found } in located {
        let (path, size, has_alpha) = match found {
            Some((path, header)) => (path, [header.width, header.height], header.has_alpha),
            None => {
                let path = PathBuf::from(&entry.file_path);
                let size = declared_size(&entry).unwrap_or_else(|| {
                    let message = "neither an image nor `w` and `h` tell the size; 800x800 is assumed";
                    notes.frame(Severity::Warning, &entry.label, message);
                    [800, 800]
                });
                (path, size, false)
            }
        };
        let (camera, remarks) = entry.intrinsics.camera(size, entry.world_from_camera);
        for remark in remarks {
            notes.frame(remark.severity, &entry.label, remark.message);
        }
        members.push((entry.split, canonical(&path)));
        frames.push(Frame { name: entry.file_path, path, camera, has_alpha });
    }
    (frames, members)
}

fn declared_size(entry: &Entry) -> Option<[u32; 2]> {
    let size = entry.intrinsics.likely_size()?.round().max(glam::DVec2::ONE);
    Some([size.x as u32, size.y as u32])
}

/// An alpha channel alone says little (screenshots have one), so the first image is looked at.
fn surroundings(frames: &[Frame], first: usize, has_images: bool) -> Result<Surroundings> {
    let frame = &frames[first];
    Ok(if !has_images {
        Surroundings::Unknown
    } else if frame.has_alpha && Image::load(&frame.path)?.is_cutout() {
        Surroundings::Empty
    } else {
        Surroundings::Background
    })
}
