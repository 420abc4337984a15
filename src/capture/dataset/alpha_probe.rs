//! A few images of a dataset, decoded to find out what their alpha means.

use anyhow::Result;
use rayon::prelude::*;

use super::Frame;
use super::notes::Notes;
use super::photo_source::How;
use super::splits::evenly_spaced;
use crate::capture::diagnostics::Severity;
use crate::capture::image_file::{Evidence, Multiplied};
use crate::capture::scene_box::Surroundings;
use crate::photo::BitDepth;
use crate::photo::{AlphaMode, Reading};
use crate::support::remedy::{Advised, Remedy};

/// Images that are looked at to find out what their alpha means.
const MOST: usize = 4;

/// The frames whose images are looked at.
pub(super) struct AlphaProbe<'a> {
    /// To train on, or all if there are none; never empty.
    pub(super) frames: Vec<&'a Frame>,
    pub(super) bits: BitDepth,
    /// Whether images that cannot be decoded are passed over, instead of being an error.
    pub(super) skips_damaged: bool,
}

impl AlphaProbe<'_> {
    /// What alpha means: as asked, or as a few of the images show.
    pub(super) fn alpha(&self, reading: &Reading, notes: &mut Notes) -> Result<AlphaMode> {
        if reading.alpha != AlphaMode::Auto {
            return Ok(reading.alpha);
        }
        if self.bits == BitDepth::Float {
            return Ok(AlphaMode::Premultiplied);
        }
        let with_alpha: Vec<_> = self.frames.iter().filter(|frame| frame.has_own_alpha).collect();
        let probed = evenly_spaced(&with_alpha, MOST);
        let how = How { multiplied: Multiplied::Straight, ..How::new(self.bits, reading) };
        let look = |frame: &&&Frame| match frame.upright(how) {
            Ok(image) => Ok(image.evidence()),
            Err(_) if self.skips_damaged => Ok(Evidence::default()),
            Err(error) => Err(error),
        };
        let evidence: Vec<Evidence> = probed.par_iter().map(look).collect::<Result<_>>()?;
        if !evidence.into_iter().fold(Evidence::default(), Evidence::and).is_premultiplied() {
            return Ok(AlphaMode::Straight);
        }
        let found = "no colour is above its alpha, though the opaque pixels are bright: the colours are taken for \
                     premultiplied with alpha; if their edges come out too bright, ";
        notes.advise(Severity::Note, Advised::new(found, Remedy::StraightAlpha, ""));
        Ok(AlphaMode::Premultiplied)
    }

    /// An alpha channel alone says little (screenshots have one), so the first image is looked at.
    pub(super) fn surroundings(&self, reading: &Reading) -> Result<Surroundings> {
        let how = How::new(self.bits, reading);
        for frame in &self.frames {
            match frame.has_alpha.then(|| frame.upright(how)).transpose() {
                Ok(Some(image)) if image.is_cutout() => return Ok(Surroundings::Empty),
                Ok(_) => return Ok(Surroundings::Background),
                Err(_) if self.skips_damaged => {}
                Err(error) => return Err(error),
            }
        }
        Ok(Surroundings::Unknown)
    }
}
