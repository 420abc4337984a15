//! Masks: which pixels of a photo they ignore.

use std::path::PathBuf;

use anyhow::Result;

use super::Frame;
use super::notes::Notes;
use crate::capture::image_file::{MaskChannel, MaskFile};

/// A mask's file.
#[derive(Clone, Debug)]
pub(super) struct Mask {
    pub(super) path: PathBuf,
    pub(super) ignores: Ignores,
    /// Whether the file has alpha.
    pub(super) has_alpha: bool,
    /// Where black and white are in those with alpha that do not tell.
    channel: MaskChannel,
}

/// Which pixels of a mask mean that the photo's are ignored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ignores {
    Black,
    AllButBlack,
}

impl Mask {
    pub(super) fn new(path: PathBuf, ignores: Ignores) -> Self {
        Self { path, ignores, has_alpha: false, channel: MaskChannel::default() }
    }

    /// Width and height, and which pixels mean that the photo's are ignored, row by row.
    pub(super) fn ignored(&self, invert: bool) -> Result<([u32; 2], Vec<bool>)> {
        let file = MaskFile::load(&self.path)?;
        let mut ignored = file.is_black(file.channel().unwrap_or(self.channel));
        let swaps = invert != (self.ignores == Ignores::AllButBlack);
        ignored.iter_mut().for_each(|ignored| *ignored ^= swaps);
        Ok((file.size(), ignored))
    }
}

/// Finds out where masks with alpha have their black and white. A mask that is the same everywhere, since nothing or
/// everything of its photo is ignored, does not tell; then the others do.
///
/// # Errors
/// When a mask cannot be read, unless `skips_damaged`.
pub(super) fn find_channels(frames: &mut [Frame], skips_damaged: bool, notes: &mut Notes) -> Result<()> {
    let masks = frames.iter_mut().flat_map(|frame| &mut frame.source.sidecars.masks);
    let mut with_alpha: Vec<&mut Mask> = masks.filter(|mask| mask.has_alpha).collect();
    for index in 0..with_alpha.len() {
        let channel = match MaskFile::load(&with_alpha[index].path) {
            Ok(file) => file.channel(),
            Err(_) if skips_damaged => None,
            Err(error) => return Err(error),
        };
        let Some(channel) = channel else { continue };
        if channel == MaskChannel::Alpha {
            let name = with_alpha[index].path.display();
            notes.note(format!(
                "masks are in the alpha channel ({name}): what is transparent counts as black, because the colours show \
                 nothing in black and white"
            ));
        }
        with_alpha.iter_mut().for_each(|mask| mask.channel = channel);
        break;
    }
    Ok(())
}
