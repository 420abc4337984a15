//! From listed frames to the files that are there, and to frames with cameras of the right size.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use anyhow::{Context, Error, Result, ensure};
use glam::DVec2;
use rayon::prelude::*;

use super::file_names::natural_order;
use super::listing::{FrameEntry, Listing};
use super::notes::Notes;
use super::photo_files::{Sought, canonical};
use super::photo_source::PhotoSource;
use super::search::Search;
use super::sidecars::{Finder, Sidecars};
use super::{Frame, OpenOptions, Split, mask, photo_files};
use crate::capture::diagnostics::Severity;
use crate::capture::image_file::Header;
use crate::capture::image_file::Turn;
use crate::capture::unreadable::{Unreadable, kinds};
use crate::photo::BitDepth;
use crate::photo::Reading;
use crate::support::remedy::{Advised, Remedy};
use crate::support::transient::is_transient;

/// A listed frame and what was found of it.
pub(super) struct ResolvedFrame {
    sought: Sought,
    /// That of its image, where there is one that can be read.
    header: Option<Header>,
    /// Why the image, which is there, cannot be read.
    damage: Option<Error>,
}

/// All listed frames that a dataset goes on with.
pub(super) struct Present {
    /// Number listed, present or not.
    pub(super) listed: usize,
    /// Names of those that are missing.
    pub(super) missing: Vec<String>,
    resolved: Vec<ResolvedFrame>,
    damaged: Vec<String>,
}

/// A frame as far as splitting goes: the split it is listed in, and its file.
pub(super) type Membership = (Option<Split>, PathBuf);

/// Frames, with what else came of making them.
pub(super) struct Built {
    pub(super) frames: Vec<Frame>,
    pub(super) members: Vec<Membership>,
    /// As [`super::Dataset::damaged`].
    pub(super) damaged: Vec<String>,
}

/// The frames of a listing that count, in natural order of their names, in the split that their file stands for.
pub(super) fn entries(mut listing: Listing, split: Option<Split>, notes: &mut Notes) -> Vec<FrameEntry> {
    notes.append(listing.notes);
    if listing.frames.iter().any(|entry| entry.split.is_some()) {
        listing.frames.retain(|entry| entry.split.is_some());
    }
    listing.frames.sort_by(|a, b| natural_order(&a.file_path, &b.file_path));
    let in_split = |entry: FrameEntry| FrameEntry { split: split.or(entry.split), ..entry };
    listing.frames.into_iter().map(in_split).collect()
}

/// Reads the headers of the images of one list, each image once.
pub(super) fn resolve(list: Vec<Sought>, notes: &mut Notes) -> Vec<ResolvedFrame> {
    let mut seen = HashSet::new();
    let mut distinct = Vec::new();
    for sought in list {
        if sought.path().map(canonical).is_some_and(|identity| !seen.insert(identity)) {
            let message = "the image is listed more than once; the first entry counts";
            notes.frame(Severity::Warning, &sought.entry.label, message);
        } else {
            distinct.push(sought);
        }
    }
    let inspect = |sought: Sought| {
        let header = sought.path().map(Header::read).transpose();
        match header.with_context(|| sought.entry.label.clone()) {
            Ok(header) => ResolvedFrame { sought, header, damage: None },
            Err(error) => ResolvedFrame { sought, header: None, damage: Some(error) },
        }
    };
    distinct.into_par_iter().map(inspect).collect()
}

/// What is wrong with the images that are there and cannot be read, a text for each kind. Failures of the moment say
/// nothing about the images, and are errors.
fn damaged(resolved: &mut [ResolvedFrame]) -> Result<Vec<String>> {
    let listed = resolved.len();
    let mut damages = resolved.iter_mut().map(|frame| &mut frame.damage);
    if let Some(error) =
        damages.find(|damage| damage.as_ref().is_some_and(is_transient)).and_then(Option::take)
    {
        return Err(error);
    }
    let unreadable = |frame: &mut ResolvedFrame| {
        Some(Unreadable { name: frame.sought.entry.file_path.clone(), error: frame.damage.take()? })
    };
    let unreadable: Vec<_> = resolved.iter_mut().filter_map(unreadable).collect();
    Ok(kinds(&unreadable, listed, "photos").into_iter().map(|kind| kind.message).collect())
}

impl Present {
    /// Sets missing and damaged frames aside.
    pub(super) fn new(
        mut resolved: Vec<ResolvedFrame>,
        search: &mut Search,
        options: &OpenOptions,
        notes: &mut Notes,
    ) -> Result<Self> {
        let listed = resolved.len();
        let unread = resolved.iter().filter(|frame| frame.header.is_none());
        let missing: Vec<_> = unread.map(|frame| frame.sought.entry.file_path.clone()).collect();
        let damaged = damaged(&mut resolved)?;
        ensure!(options.allow_missing || damaged.is_empty(), damaged.join("; "));
        let nowhere: Vec<&Sought> =
            resolved.iter().map(|frame| &frame.sought).filter(|sought| sought.path().is_none()).collect();
        if !nowhere.is_empty() {
            let message = photo_files::missing(&nowhere, listed, search.root);
            if nowhere.len() < listed {
                notes.warn(format!("{message}; they are skipped"));
            } else {
                let message = format!("{message}; {}", photo_files::remedy(&nowhere, search));
                ensure!(options.allow_missing, message);
                notes.error(message);
            }
        }
        let is_any_found = missing.len() < listed;
        let resolved = resolved.into_iter().filter(|frame| frame.header.is_some() || !is_any_found).collect();
        Ok(Self { listed, missing, resolved, damaged })
    }

    /// The depth of the finest images; display-referred and linear ones do not mix.
    pub(super) fn bit_depth(&self, notes: &mut Notes) -> Result<BitDepth> {
        let found = || self.resolved.iter().filter_map(|frame| frame.sought.path().zip(frame.header));
        let first = |bits: BitDepth| found().find(|(_, header)| header.bits == bits);
        let finest = found().map(|(_, header)| header.bits).max().unwrap_or(BitDepth::Eight);
        let coarsest = found().map(|(_, header)| header.bits).min().unwrap_or(BitDepth::Eight);
        if let (Some((fine, _)), Some((coarse, _)), true) =
            (first(finest), first(coarsest), finest > coarsest)
        {
            ensure!(
                finest < BitDepth::Float,
                "expected all images in a linear format (OpenEXR, Radiance HDR, TIFF with floats) or none, found {} \
                 beside {}; convert one kind",
                fine.display(),
                coarse.display()
            );
            notes.note("some images have 8 bits and some 16; all are used with 16");
        }
        Ok(finest)
    }

    /// Frames with cameras at the size of their photos, and what the splits need to know.
    pub(super) fn build(self, search: Search, options: &OpenOptions, notes: &mut Notes) -> Result<Built> {
        let reading = &options.reading;
        let mut damaged = self.damaged;
        let photos = self.resolved.iter().filter_map(|frame| frame.sought.path().map(Path::to_owned));
        let mut finder = Finder::new(search, photos.collect());
        let is_any_found = self.resolved.iter().any(|frame| frame.header.is_some());
        let (mut unreadable, mut listed_masks) = (Vec::new(), 0);
        let mut members = Vec::new();
        let mut frames = Vec::new();
        for ResolvedFrame { sought, header, .. } in self.resolved {
            let found = sought.path().map(Path::to_owned).zip(header);
            let entry = sought.entry;
            let frame = match found {
                Some((path, header)) => {
                    let mut sidecars = finder.find(&entry, &path, notes);
                    listed_masks += sidecars.masks.len();
                    if options.allow_missing {
                        unreadable.extend(sidecars.drop_damaged_masks(&entry.label));
                    }
                    frame(&entry, (path, header), sidecars, reading, notes)
                }
                None => absent(&entry, reading, notes),
            };
            let frame = frame.with_context(|| entry.label.clone())?;
            members.push((entry.split, canonical(&frame.path)));
            frames.push(frame);
        }
        mask::find_channels(&mut frames, options.allow_missing, notes)?;
        let kinds = kinds(&unreadable, listed_masks, "masks");
        damaged.extend(kinds.into_iter().map(|kind| kind.message));
        finder.tell_guesses(notes);
        remark_on_masks(&frames, &finder, is_any_found && reading.invert_masks, notes);
        Ok(Built { frames, members, damaged })
    }
}

/// Remarks on frames without masks, where that may not be meant.
fn remark_on_masks(frames: &[Frame], finder: &Finder, inverts: bool, notes: &mut Notes) {
    let (all, unmasked) = (frames.len(), frames.iter().filter(|frame| !frame.has_mask).count());
    if unmasked > 0 && unmasked < all {
        notes.note(format!("{unmasked} of {all} frames have no mask; all their pixels count"));
    }
    if unmasked == all {
        finder.unmatched_masks().into_iter().for_each(|message| notes.warn(message));
        if inverts {
            let found = "masks are to be inverted, but no frame has one; add the masks, or ";
            notes.advise(Severity::Warning, Advised::new(found, Remedy::LeaveMasks, ""));
        }
    }
}

/// A frame whose image was found.
fn frame(
    entry: &FrameEntry,
    (path, header): (PathBuf, Header),
    mut sidecars: Sidecars,
    reading: &Reading,
    notes: &mut Notes,
) -> Result<Frame> {
    let stored = [header.width, header.height];
    let turn = turn(entry, &header, notes);
    let upright = turn.map_or(stored, |turn| turn.size(stored));
    for mask in &mut sidecars.masks {
        let header = Header::read(&mask.path)?;
        mask.has_alpha = header.has_alpha;
        let size = [header.width, header.height];
        if size != stored && size != upright {
            let message = "its mask has another size; each pixel takes the nearest of the mask's";
            notes.frame(Severity::Note, &entry.label, message);
        }
    }
    let (window, size) = reading.part(upright)?;
    let (camera, remarks) = entry.intrinsics.camera(upright, entry.world_from_camera);
    for remark in remarks {
        notes.frame(remark.severity, &entry.label, remark.message);
    }
    let is_keyed = entry.color_key.words().is_some() && header.bits != BitDepth::Float;
    Ok(Frame {
        name: entry.file_path.clone(),
        path,
        camera: camera.cropped(window.corner, window.size).resized(size[0], size[1]),
        has_alpha: header.has_alpha || sidecars.alpha.is_some() || is_keyed,
        has_own_alpha: header.has_alpha,
        bits: header.bits,
        has_mask: !sidecars.masks.is_empty(),
        has_depth: sidecars.depth.is_some(),
        source: PhotoSource { stored, turn, window, sidecars, color_key: entry.color_key },
    })
}

/// A frame without an image, of the size that the file declares.
fn absent(entry: &FrameEntry, reading: &Reading, notes: &mut Notes) -> Result<Frame> {
    let size = entry.declared_size().unwrap_or_else(|| {
        let message = "neither an image nor `w` and `h` tell the size; 800x800 is assumed";
        notes.frame(Severity::Warning, &entry.label, message);
        [800, 800]
    });
    let [width, height] = size;
    let header = Header { width, height, has_alpha: false, bits: BitDepth::Eight, orientation: None };
    let path = PathBuf::from(&entry.file_path);
    frame(entry, (path, header), Sidecars::default(), reading, notes)
}

/// Whether and how an image is turned. Structure from motion takes pixels as they are stored, whatever a
/// photo's metadata tells viewers to do, so poses belong to the stored pixels, unless the size that the dataset
/// declares says that they do not.
fn turn(entry: &FrameEntry, header: &Header, notes: &mut Notes) -> Option<Turn> {
    let orientation = header.orientation?;
    let stored = DVec2::new(f64::from(header.width), f64::from(header.height));
    let fits = |size: DVec2| {
        let ratio = entry.intrinsics.declared_size? / size;
        Some((ratio.x / ratio.y - 1.0).abs() < 0.02)
    };
    if let Some(turn) = Turn::of(orientation).filter(|_| fits(stored) == Some(false))
        && fits(DVec2::new(stored.y, stored.x)) == Some(true)
    {
        let message = "its metadata asks viewers to turn the image, and `w` and `h` fit only the turned one; it is \
                       turned";
        notes.frame(Severity::Note, &entry.label, message);
        return Some(turn);
    }
    let message = "its metadata asks viewers to turn the image; its pixels are used as they are stored, because \
                   poses belong to those";
    notes.frame(Severity::Note, &entry.label, message);
    None
}
