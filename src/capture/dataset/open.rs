//! Opening a dataset: find its files, parse them, look for the images, split, and bound the scene.

use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};

use super::alpha_probe::AlphaProbe;
use super::listing::FrameEntry;
use super::not_a_dataset;
use super::notes::Notes;
use super::photo_files;
use super::resolved_frames::{Built, Present, entries, resolve};
use super::search::Search;
use super::transforms;
use super::{Dataset, HoldOut, OpenOptions, Split, splits, surfaces};
use crate::camera::Bounds;
use crate::camera::Camera;
use crate::capture::scene_box::Surroundings;
use crate::photo::BitDepth;

impl Dataset {
    /// Opens a folder or a single .json file; of the images, all headers are read and a few are decoded.
    ///
    /// # Errors
    /// When a file cannot be read or understood, when no listed image is there, or when the images cannot be
    /// trained on together; messages name the file, or the frame and the key.
    pub fn open(path: &Path, options: &OpenOptions) -> Result<Self> {
        if let HoldOut::Every(every) = options.hold_out {
            ensure!(every >= 2, "cannot hold out one frame in {every}: expected 2 or more, or none at all");
        }
        let mut notes = Notes::default();
        let sources = sources(path, &mut notes)?;
        let root = folder_of(&sources[0].1);
        let mut lists = Vec::new();
        let mut scene_box = None;
        let mut point_cloud = None;
        let files: Vec<&Path> = sources.iter().map(|(_, path)| path.as_path()).collect();
        let listings = transforms::read(&files, &mut notes)?;
        let dialect = listings.first().map_or("", |listing| listing.dialect);
        for ((split, _), listing) in sources.iter().zip(listings) {
            // The training file speaks for the scene.
            scene_box = scene_box.or(listing.scene_box);
            point_cloud = point_cloud.or(listing.point_cloud.clone());
            lists.push(entries(listing, *split, &mut notes));
        }
        let mut search = Search::new(&root);
        let mut resolved = Vec::new();
        for list in photo_files::find(lists, &mut search, &mut notes) {
            resolved.extend(resolve(list, &mut notes));
        }
        let present = Present::new(resolved, &mut search, options, &mut notes)?;
        let bit_depth = present.bit_depth(&mut notes)?;
        let (listed, missing) = (present.listed, present.missing.clone());
        let Built { frames, members, damaged } = present.build(search, options, &mut notes)?;
        let members: Vec<_> = members.iter().map(|(s, path)| (*s, path.as_path())).collect();
        let mut splits = splits::assign(&members, options.hold_out, &mut notes);
        thin_out(&mut splits.train, options.reading.max_images, &mut notes);
        let used = if splits.train.is_empty() { (0..frames.len()).collect() } else { splits.train.clone() };
        let has_images = missing.len() < listed;
        let mut reading = options.reading.clone();
        let probe = AlphaProbe {
            frames: used.iter().map(|&i| &frames[i]).collect(),
            bits: bit_depth,
            skips_damaged: options.allow_missing,
        };
        reading.alpha = probe.alpha(&reading, &mut notes)?;
        let surroundings = match has_images {
            true => probe.surroundings(&reading)?,
            false => Surroundings::Unknown,
        };
        let cameras: Vec<&Camera> = used.iter().map(|&i| &frames[i].camera).collect();
        let known = |notes: &mut Notes| {
            let cloud = point_cloud.and_then(|named| surfaces::of_cloud(&root, &named, &cameras, notes));
            cloud.or_else(|| surfaces::of_depth(&probe.frames))
        };
        let bounds = Bounds::choose(&cameras, scene_box, surroundings, known, &mut notes);
        Ok(Self {
            root,
            files: sources.into_iter().map(|(_, path)| path).collect(),
            dialect: dialect.to_owned(),
            frames,
            train: splits.train,
            val: splits.val,
            test: splits.test,
            listed,
            missing,
            damaged,
            is_hdr: bit_depth == BitDepth::Float,
            bit_depth,
            reading,
            is_cutout: surroundings == Surroundings::Empty,
            notes: notes.finish(),
            bounds,
        })
    }
}

/// Keeps at most so many frames to train on, evenly spaced.
fn thin_out(train: &mut Vec<usize>, most: Option<usize>, notes: &mut Notes) {
    let count = train.len();
    if let Some(most) = most.filter(|&most| most < count) {
        *train = splits::evenly_spaced(train, most);
        notes.note(format!("{most} of {count} frames are trained on, evenly spaced, as asked"));
    }
}

/// The files to read, training first, each with the split it stands for.
fn sources(path: &Path, notes: &mut Notes) -> Result<Vec<(Option<Split>, PathBuf)>> {
    if path.is_file() {
        if let Some(error) = not_a_dataset::file(path) {
            return Err(error);
        }
        let split = match path.file_name().and_then(|name| name.to_str()) {
            Some("transforms_val.json") => Some(Split::Val),
            Some("transforms_test.json") => Some(Split::Test),
            _ => None,
        };
        return Ok(vec![(split, path.to_owned())]);
    }
    if !path.is_dir() {
        return Err(not_a_dataset::nowhere(path));
    }
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
        (None, _) => Err(not_a_dataset::folder(path)),
    }
}

fn folder_of(file: &Path) -> PathBuf {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

impl FrameEntry {
    /// The size in whole pixels that the file declares.
    pub(super) fn declared_size(&self) -> Option<[u32; 2]> {
        let size = self.intrinsics.likely_size()?.round().max(glam::DVec2::ONE);
        Some([size.x as u32, size.y as u32])
    }
}
