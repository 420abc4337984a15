//! Masks: pictures of which only matters where they are black.

use std::collections::HashSet;
use std::path::Path;

use anyhow::Result;

use super::decode::is_lossy;
use crate::photo::{Image, Pixels};

/// More colours than a mask has that is painted in greys: a picture.
const MOST_COLORS: usize = 256;

/// Where a mask's file has its black and white.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum MaskChannel {
    /// In its colours: black is 0 in red, green and blue.
    #[default]
    Color,
    /// In its alpha: what is transparent is black.
    Alpha,
}

/// A mask as its file has it.
#[derive(Debug)]
pub(crate) struct MaskFile {
    image: Image,
    /// Whether the colours are only about those that were written.
    is_lossy: bool,
}

impl MaskFile {
    /// Decodes a file of any format that photos may have.
    ///
    /// # Errors
    /// As [`Image::load`].
    pub(crate) fn load(path: &Path) -> Result<Self> {
        Ok(Self { image: Image::load(path)?, is_lossy: is_lossy(path)? })
    }

    /// Width and height in pixels.
    pub(crate) fn size(&self) -> [u32; 2] {
        self.image.size()
    }

    /// Where black and white are; `None` where neither colours nor alpha of the file differ, which says nothing.
    pub(crate) fn channel(&self) -> Option<MaskChannel> {
        if !self.image.has_alpha {
            return Some(MaskChannel::Color);
        }
        let bits = |value: f32| value.to_bits();
        let colors = match &self.image.pixels {
            Pixels::Srgb8(pixels) => Colors::of(pixels.iter().map(|pixel| pixel.map(u32::from))),
            Pixels::Srgb16(pixels) => Colors::of(pixels.iter().map(|pixel| pixel.map(u32::from))),
            Pixels::Linear(pixels) => Colors::of(pixels.iter().map(|pixel| pixel.map(bits))),
        };
        match (colors.has_alphas, colors.visible) {
            (false, 0..=1) => None,
            (true, visible) if visible <= 1 || visible > MOST_COLORS => Some(MaskChannel::Alpha),
            _ => Some(MaskChannel::Color),
        }
    }

    /// Where it is black, `[height * width]`: at exactly 0, whatever the brightest value is, so that masks of zeros and
    /// ones, of zeros and 255s and of class numbers all mean what they say. Lossy files have noise at edges, so that
    /// they are split at half of their brightest.
    pub(crate) fn is_black(&self, channel: MaskChannel) -> Vec<bool> {
        let values = match channel {
            MaskChannel::Color => self.image.brightness(),
            MaskChannel::Alpha => self.image.alpha(),
        };
        let brightest = if self.is_lossy { values.iter().copied().max().unwrap_or(0) } else { 0 };
        values.into_iter().map(|value| value == 0 || u32::from(value) * 2 < u32::from(brightest)).collect()
    }
}

/// What there is in a picture.
struct Colors {
    /// Whether alpha differs.
    has_alphas: bool,
    /// Number of different colours that are not wholly transparent, one more than [`MOST_COLORS`] at most.
    visible: usize,
}

impl Colors {
    fn of(pixels: impl Iterator<Item = [u32; 4]>) -> Self {
        let mut alphas = None;
        let mut has_alphas = false;
        let mut visible = HashSet::new();
        let mut last = None;
        for pixel @ [r, g, b, alpha] in pixels {
            if last.replace(pixel) == Some(pixel) {
                continue;
            }
            has_alphas |= *alphas.get_or_insert(alpha) != alpha;
            if alpha > 0 && visible.len() <= MOST_COLORS {
                visible.insert([r, g, b]);
            }
        }
        Self { has_alphas, visible: visible.len() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use MaskChannel::{Alpha, Color};

    fn mask(pixels: &[[u8; 4]], is_lossy: bool) -> MaskFile {
        let (width, pixels) = (pixels.len() as u32, Pixels::Srgb8(pixels.to_vec()));
        MaskFile { image: Image { width, height: 1, pixels, has_alpha: true }, is_lossy }
    }

    fn greys(values: &[u8], is_lossy: bool) -> Vec<bool> {
        let pixels: Vec<_> = values.iter().map(|&value| [value, value, value, 255]).collect();
        mask(&pixels, is_lossy).is_black(Color)
    }

    #[test]
    fn black_is_zero_whatever_the_brightest_is() {
        assert_eq!(greys(&[0, 1, 1], false), [true, false, false], "zeros and ones");
        assert_eq!(greys(&[0, 1, 7], false), [true, false, false], "class numbers");
        assert_eq!(greys(&[0, 3, 255], false), [true, false, false]);
        assert_eq!(greys(&[0, 0], false), [true, true], "nothing but black");
        assert_eq!(greys(&[9, 9], false), [false, false], "nothing but grey");
        let green = mask(&[[0, 128, 0, 255], [0, 0, 0, 255]], false);
        assert_eq!(green.is_black(Color), [false, true]);
    }

    #[test]
    fn noise_in_lossy_files_is_black() {
        assert_eq!(greys(&[0, 9, 110, 140, 248], true), [true, true, true, false, false]);
        assert_eq!(greys(&[0, 0], true), [true, true], "nothing but black");
        assert_eq!(greys(&[250, 255], true), [false, false], "nothing but white");
    }

    #[test]
    fn alpha_is_the_mask_where_colours_are_none() {
        let painted = mask(&[[0, 0, 0, 0], [0, 0, 0, 255]], false);
        assert_eq!(painted.channel(), Some(Alpha), "one colour");
        assert_eq!(painted.is_black(Alpha), [true, false]);
        assert_eq!(mask(&[[255, 255, 255, 0], [0, 0, 0, 255], [0, 0, 0, 9]], false).channel(), Some(Alpha));
        let picture: Vec<_> = (0..=255).flat_map(|i| [[i, 0, 9, 255], [i, 9, 0, i / 128 * 255]]).collect();
        assert_eq!(mask(&picture, false).channel(), Some(Alpha), "a cut-out picture");
        assert_eq!(mask(&[[0, 0, 0, 255], [255, 255, 255, 255]], false).channel(), Some(Color));
        assert_eq!(mask(&[[0, 0, 0, 255], [255, 255, 255, 128]], false).channel(), Some(Color));
        assert_eq!(mask(&[[0, 0, 0, 255]; 2], false).channel(), None, "the same everywhere");
        assert_eq!(mask(&[[7, 7, 7, 0]; 2], false).channel(), None);
    }
}
