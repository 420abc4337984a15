//! Files beside a photo that say more about its pixels: masks, alpha and depth.
//!
//! A mask says which pixels are not to be learnt from; that is something else than alpha, which says where there is nothing.
//! Tools do not agree on what the colours of a mask mean, so it depends on how a mask was found:
//!
//! | found by | ignored | convention of |
//! | --- | --- | --- |
//! | `mask_path` of the frame | black | nerfstudio |
//! | folder `masks` beside the images' folder or in the dataset | black | brush, COLMAP |
//! | `dynamic_mask_<stem>.png` beside the image | everything but black | instant-ngp |
//!
//! A photo may have several; a pixel that one of them ignores is ignored.

use std::collections::HashSet;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use super::depth::DepthFile;
use super::file_names::with_extensions;
use super::guesses::Guesses;
use super::json::Fields;
use super::listing::{DepthEntry, DepthScale, FrameEntry};
use super::mask::{Ignores, Mask};
use super::notes::Notes;
use super::search::{Found, Role, Search};
use crate::capture::diagnostics::Severity;
use crate::capture::image_file::Header;
use crate::capture::unreadable::Unreadable;
use crate::photo::BitDepth;

/// The files beside one photo.
#[derive(Clone, Debug, Default)]
pub(super) struct Sidecars {
    pub(super) masks: Vec<Mask>,
    /// An image whose red channel is the photo's alpha.
    pub(super) alpha: Option<PathBuf>,
    pub(super) depth: Option<DepthFile>,
}

impl Sidecars {
    /// Drops masks whose headers cannot be read, and says why they cannot; `owner` names the frame.
    pub(super) fn drop_damaged_masks(&mut self, owner: &str) -> Vec<Unreadable> {
        let mut unreadable = Vec::new();
        self.masks.retain(|mask| {
            let header = Header::read(&mask.path).with_context(|| owner.to_owned());
            let name = || mask.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            header.map_err(|error| unreadable.push(Unreadable { name: name(), error })).is_ok()
        });
        unreadable
    }
}

/// What a frame lists: its mask, and its depth.
pub(super) fn listed(frame: Fields, file: Fields) -> Result<(Option<String>, Option<DepthEntry>)> {
    let name = |key| Ok::<_, anyhow::Error>(frame.text(key)?.map(|path| path.replace('\\', "/")));
    let positive = |key: &str| {
        let in_frame = frame.positive(key, f64::INFINITY)?;
        Ok::<_, anyhow::Error>(in_frame.or(file.positive(key, f64::INFINITY)?))
    };
    // nerfstudio's factor is for all numbers, the others are for whole ones; datasets for dense depth priors state the
    // steps per world unit instead.
    let factor = positive("depth_unit_scale_factor")?;
    let stated = match factor {
        None => positive("depth_scaling_factor")?.map(f64::recip).or(positive("integer_depth_scale")?),
        stated => stated,
    };
    let lengths = factor.unwrap_or(1.0);
    let depth = match (name("depth_file_path")?, name("depth_path")?) {
        // nerfstudio's depth is in millimetres unless the file says otherwise.
        (Some(path), _) => {
            Some(DepthEntry { path, scale: DepthScale { steps: stated.or(Some(1e-3)), lengths } })
        }
        (None, Some(path)) => Some(DepthEntry { path, scale: DepthScale { steps: stated, lengths } }),
        (None, None) => None,
    };
    Ok((name("mask_path")?, depth))
}

/// Looks for the files beside photos.
pub(super) struct Finder<'a> {
    search: Search<'a>,
    /// Files that are photos, and so nothing beside one.
    photos: HashSet<PathBuf>,
    masks: Guesses,
    depths: Guesses,
    /// A folder `masks` and the first photo that has none in it.
    unmatched: Option<(PathBuf, PathBuf)>,
}

impl<'a> Finder<'a> {
    /// For a dataset with these photos.
    pub(super) fn new(search: Search<'a>, photos: HashSet<PathBuf>) -> Self {
        Self { search, photos, masks: Guesses::default(), depths: Guesses::default(), unmatched: None }
    }

    /// The file that a frame lists beside its photo; `missing` is said where there is none.
    fn listed(
        &mut self,
        (name, role): (&str, Role),
        missing: &str,
        entry: &FrameEntry,
        notes: &mut Notes,
    ) -> Option<PathBuf> {
        let photos = &self.photos;
        match self.search.find(name, role, &|path| !photos.contains(path)) {
            Found::One(path, way) => {
                let guesses = if role == Role::Mask { &mut self.masks } else { &mut self.depths };
                guesses.add(name, &path, way, self.search.root);
                return Some(path);
            }
            Found::Several(_) => {
                let message = format!("{missing}, and several files are called like it");
                notes.frame(Severity::Warning, &entry.label, message);
            }
            Found::Shared(_) | Found::Nothing => notes.frame(Severity::Warning, &entry.label, missing),
        }
        None
    }

    /// The files beside the photo of `entry`, which was found at `image`.
    pub(super) fn find(&mut self, entry: &FrameEntry, image: &Path, notes: &mut Notes) -> Sidecars {
        let mut masks = Vec::new();
        if let Some(listed) = &entry.mask_path {
            let missing = "the frame is used without a mask: the one that `mask_path` names is missing";
            let found = self.listed((listed, Role::Mask), missing, entry, notes);
            masks.extend(found.map(|path| Mask::new(path, Ignores::Black)));
        }
        let in_folder = self.in_masks_folder(image);
        masks.extend(in_folder.map(|path| Mask::new(path, Ignores::Black)));
        masks.dedup_by(|a, b| same(&a.path, &b.path));
        let dynamic = named(image, |stem| joined([OsStr::new("dynamic_mask_"), stem, OsStr::new(".png")]));
        if let Some(path) = dynamic.filter(|path| self.is_there(path)) {
            masks.push(Mask::new(path, Ignores::AllButBlack));
        }
        Sidecars { masks, alpha: self.alpha(image), depth: self.depth(entry, notes) }
    }

    /// `masks/<name>` beside one of the folders that the image is in or in the dataset's; the name with or
    /// without the images' folder, with any extension in place of the image's or after it.
    fn in_masks_folder(&mut self, image: &Path) -> Option<PathBuf> {
        let is_below_root = image.starts_with(self.search.root);
        let root = self.search.root;
        let own = image.parent()?;
        for folder in image.ancestors().skip(1) {
            let is_last = folder == root || (!is_below_root && Some(folder) == own.parent());
            let masks = folder.join("masks");
            if (folder != own || is_last) && self.is_there(&masks) {
                let whole = image.strip_prefix(folder).ok()?;
                let mut parts = whole.components();
                parts.next();
                let names = [whole, parts.as_path()].into_iter().filter(|name| !name.as_os_str().is_empty());
                let beside = names.map(|name| masks.join(name));
                // `0001.jpg`, `0001.jpg.png`, then `0001.png`.
                let mut spellings = beside.flat_map(|path| {
                    let stem = path.with_extension("");
                    with_extensions(&path).chain(with_extensions(&stem).skip(1))
                });
                let found = spellings.find(|path| path != image && self.is_there(path));
                if found.is_some() {
                    return found;
                }
                if !image.starts_with(&masks) {
                    self.unmatched.get_or_insert_with(|| (masks, image.to_owned()));
                }
            }
            if is_last {
                break;
            }
        }
        None
    }

    /// Where no photo has a mask though there is a folder of them: how they are named, and how they should be.
    pub(super) fn unmatched_masks(&self) -> Option<String> {
        let (masks, image) = self.unmatched.as_ref()?;
        let names = std::fs::read_dir(masks).ok()?.flatten().map(|entry| entry.file_name());
        let first =
            names.map(|name| name.to_string_lossy().into_owned()).filter(|name| !name.starts_with('.'));
        Some(format!(
            "no mask in {} is named like a photo: found {}, expected {}.png for {}; no mask is used; name each mask like \
             its photo",
            masks.display(),
            first.min()?,
            image.file_stem()?.to_string_lossy(),
            image.file_name()?.to_string_lossy()
        ))
    }

    /// `<image>.alpha.<extension>`, the image named with its extension or without.
    fn alpha(&mut self, image: &Path) -> Option<PathBuf> {
        let extension = image.extension()?;
        let end = joined([OsStr::new(".alpha."), extension]);
        let long = image.with_file_name(joined([image.file_name()?, &end]));
        let short = named(image, |stem| joined([stem, &end]))?;
        [long, short].into_iter().find(|path| self.is_there(path))
    }

    fn depth(&mut self, entry: &FrameEntry, notes: &mut Notes) -> Option<DepthFile> {
        let listed = entry.depth.as_ref()?;
        let path = self.listed((&listed.path, Role::Depth), "its depth file is missing", entry, notes)?;
        // A header that cannot be read is one of a TIFF with a single channel of floats, or comes up on loading.
        let counts_steps = || Header::read(&path).is_ok_and(|header| header.bits != BitDepth::Float);
        if listed.scale.steps.is_none() && counts_steps() {
            let message = "the depth file has whole numbers, but no `integer_depth_scale` says how long a step \
                           is; it is not used";
            notes.frame(Severity::Warning, &entry.label, message);
            return None;
        }
        Some(DepthFile { path, scale: listed.scale })
    }

    fn is_there(&mut self, path: &Path) -> bool {
        self.search.folders.has(path)
    }

    /// Says which listed files were not where they are listed.
    pub(super) fn tell_guesses(&self, notes: &mut Notes) {
        self.masks.tell("masks", "mask_path", notes);
        self.depths.tell("depth files", "depth_file_path", notes);
    }
}

fn joined<const N: usize>(parts: [&OsStr; N]) -> OsString {
    parts.into_iter().collect()
}

/// The file beside `image` whose name is made of the image's stem.
fn named(image: &Path, name: impl FnOnce(&OsStr) -> OsString) -> Option<PathBuf> {
    Some(image.with_file_name(name(image.file_stem()?)))
}

fn same(a: &Path, b: &Path) -> bool {
    a == b || a.canonicalize().ok().zip(b.canonicalize().ok()).is_some_and(|(a, b)| a == b)
}
