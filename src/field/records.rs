//! The training photos on the device: one record per pixel that can be drawn.
//!
//! A record is a few words: the colour as the photo has it, then the pixel's position where masks left pixels out,
//! then its depth where depth is trained on. Ignored pixels have no record, so they are never drawn.

use super::Plan;
use crate::gpu::paged_array::{self, rows_of};
use crate::photo::{BitDepth, Photo, Pixels};
use anyhow::{Result, ensure};
use std::borrow::Cow;

/// The name that kernels know the records by.
pub const NAME: &str = "photos";

/// Which words of a record hold what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record {
    /// Words of the colour, the first ones: one of 8 bits a channel, two of 16, four of linear floats.
    color: usize,
    /// Whether kernels take every pixel for opaque.
    is_opaque: bool,
    /// Whether the next word is the pixel's position in its photo, row by row.
    has_position: bool,
    /// Whether the last word is the depth.
    has_depth: bool,
}

/// Factors from a photo to its records.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// Field colours per scene-linear colour; 1 for others.
    pub color: f32,
    /// Sides of the inner cube per world unit.
    pub depth: f32,
}

impl Record {
    /// Words of a record.
    #[must_use]
    pub fn words(&self) -> usize {
        self.color + usize::from(self.has_position) + usize::from(self.has_depth)
    }

    /// The word that holds the position.
    #[must_use]
    pub fn position(&self) -> usize {
        self.color
    }

    /// The word that holds the depth.
    #[must_use]
    pub fn depth(&self) -> usize {
        self.color + usize::from(self.has_position)
    }

    /// Rows of the pages that a photo of `pixels` pixels takes at most.
    #[must_use]
    pub fn rows(&self, pixels: usize) -> usize {
        rows_of(pixels * self.words())
    }

    /// The records of a photo.
    ///
    /// # Errors
    /// When they could not hold it: it is of other pixels, or has masks or transparency that the scene's features do not
    /// tell of.
    pub fn of<'a>(&self, photo: &'a Photo, units: Units) -> Result<Cow<'a, [u32]>> {
        self.check(photo)?;
        if let (Pixels::Srgb8(pixels), 1, true) =
            (&photo.image.pixels, self.words(), photo.ignored.is_empty())
        {
            return Ok(Cow::Borrowed(bytemuck::cast_slice(pixels)));
        }
        let count = photo.image.width as usize * photo.image.height as usize;
        let counts = |pixel: &usize| !photo.ignored.get(*pixel).copied().unwrap_or(false);
        let mut words = Vec::with_capacity(count * self.words());
        for pixel in (0..count).filter(counts) {
            self.push_color(&photo.image.pixels, pixel, units.color, &mut words);
            if self.has_position {
                words.push(pixel as u32);
            }
            if self.has_depth {
                let depth = photo.depth.get(pixel).copied().unwrap_or(0.0) * units.depth;
                words.push(depth.to_bits());
            }
        }
        Ok(Cow::Owned(words))
    }

    /// Whether a record holds all channels of the photo. Without positions a pixel's record is found by its number, so
    /// that one left out would move all behind it; without alpha what is transparent would be trained on as it is stored.
    fn check(&self, photo: &Photo) -> Result<()> {
        let Photo { image, ignored, depth, .. } = photo;
        let count = image.width as usize * image.height as usize;
        let pixels = image.pixels.count();
        ensure!(
            pixels == count && [0, count].contains(&ignored.len()) && [0, count].contains(&depth.len()),
            "expected {count} pixels of {}x{}, found {pixels}, {} of its mask and {} of its depth; all have one size",
            image.width,
            image.height,
            ignored.len(),
            depth.len()
        );
        let (bits, holds) = (image.pixels.bits(), self.holds());
        ensure!(
            bits == holds || (bits, holds) == (BitDepth::Eight, BitDepth::Sixteen),
            "expected pixels of {}, as the scene's features say, found {}; {TAKE_FEATURES}",
            name(holds),
            name(bits)
        );
        let ignored = photo.count_ignored();
        ensure!(
            self.has_position || ignored == 0,
            "expected a photo whose pixels all count, as the scene's features say (masks), found {ignored} ignored \
             ones; {TAKE_FEATURES}"
        );
        ensure!(
            !(self.is_opaque && image.has_alpha && image.is_cutout()),
            "expected an opaque photo, as the scene's features say (alpha), found transparent pixels; {TAKE_FEATURES}"
        );
        Ok(())
    }

    /// The finest pixels that fit.
    fn holds(&self) -> BitDepth {
        match self.color {
            1 => BitDepth::Eight,
            2 => BitDepth::Sixteen,
            _ => BitDepth::Float,
        }
    }

    fn push_color(&self, pixels: &Pixels, pixel: usize, unit: f32, words: &mut Vec<u32>) {
        match pixels {
            Pixels::Srgb8(data) if self.color == 1 => words.push(u32::from_le_bytes(data[pixel])),
            // 255 * 257 = 65535.
            Pixels::Srgb8(data) => words.extend(pairs(data[pixel].map(|value| u16::from(value) * 257))),
            Pixels::Srgb16(data) => words.extend(pairs(data[pixel])),
            Pixels::Linear(data) => {
                let [r, g, b, alpha] = data[pixel];
                words.extend([r * unit, g * unit, b * unit, alpha].map(f32::to_bits));
            }
        }
    }
}

/// What to do about a photo that the plan's features do not cover.
const TAKE_FEATURES: &str =
    "take the features of the photos themselves (SceneFeatures::of), or start again if a file has changed";

fn name(bits: BitDepth) -> &'static str {
    match bits {
        BitDepth::Eight => "8 bits a channel",
        BitDepth::Sixteen => "16 bits a channel",
        BitDepth::Float => "linear floats",
    }
}

/// Two values of 16 bits per word.
fn pairs([r, g, b, a]: [u16; 4]) -> [u32; 2] {
    let pair = |low: u16, high: u16| u32::from(low) | u32::from(high) << 16;
    [pair(r, g), pair(b, a)]
}

impl Plan {
    /// What the device keeps of a pixel.
    #[must_use]
    pub fn record(&self) -> Record {
        let features = &self.features;
        let color = match (features.hdr, features.deep) {
            (true, _) => 4,
            (false, true) => 2,
            (false, false) => 1,
        };
        let is_opaque = color == 1 && !features.alpha;
        Record { color, is_opaque, has_position: features.masks, has_depth: features.depth }
    }

    /// Bytes of all photos of these numbers of pixels.
    #[must_use]
    pub fn photo_bytes(&self, pixels: impl Iterator<Item = usize>) -> u64 {
        paged_array::bytes_of(pixels.map(|pixels| self.record().rows(pixels)).sum())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::photo::Image;

    fn photo(pixels: Pixels, ignored: Vec<bool>, depth: Vec<f32>) -> Photo {
        Photo {
            image: Image { width: 2, height: 1, pixels, has_alpha: true },
            ignored,
            depth,
            far_depth: 0.0,
        }
    }

    const UNITS: Units = Units { color: 0.5, depth: 2.0 };

    #[test]
    fn plain_photos_are_not_copied() {
        let photo = photo(Pixels::Srgb8(vec![[1, 2, 3, 4], [5, 6, 7, 8]]), vec![], vec![]);
        let record = Record { color: 1, is_opaque: false, has_position: false, has_depth: false };
        let words = record.of(&photo, UNITS).expect("of its kind");
        assert!(matches!(words, Cow::Borrowed(_)));
        assert_eq!(*words, [0x0403_0201, 0x0807_0605]);
        assert_eq!((record.rows(0), record.rows(4096), record.rows(4097)), (0, 1, 2));
    }

    #[test]
    fn ignored_pixels_have_no_record() {
        let photo = photo(Pixels::Srgb8(vec![[255; 4], [1, 2, 3, 4]]), vec![true, false], vec![1.0, 3.0]);
        let record = Record { color: 2, is_opaque: false, has_position: true, has_depth: true };
        let words = record.of(&photo, UNITS).expect("of its kind");
        let wide = |low: u32, high: u32| (low * 257) | ((high * 257) << 16);
        assert_eq!(*words, [wide(1, 2), wide(3, 4), 1, 6.0f32.to_bits()]);
    }

    #[test]
    fn linear_photos_are_scaled_but_for_their_alpha() {
        let photo = photo(Pixels::Linear(vec![[2.0, 4.0, 8.0, 0.5]; 2]), vec![], vec![]);
        let record = Record { color: 4, is_opaque: false, has_position: false, has_depth: true };
        let words = record.of(&photo, UNITS).expect("of its kind");
        let floats: Vec<f32> = words.iter().map(|&word| f32::from_bits(word)).collect();
        assert_eq!(floats, [1.0, 2.0, 4.0, 0.5, 0.0, 1.0, 2.0, 4.0, 0.5, 0.0]);
        let narrow = Record { color: 1, is_opaque: false, has_position: false, has_depth: false };
        assert!(narrow.of(&photo, UNITS).is_err());
    }

    /// Records of one word, without positions and depth.
    const NARROW: Record = Record { color: 1, is_opaque: true, has_position: false, has_depth: false };

    fn refusal(record: Record, photo: &Photo) -> String {
        record.of(photo, UNITS).err().map_or_else(String::new, |error| error.to_string())
    }

    #[test]
    fn photos_that_no_record_holds_are_refused() {
        let opaque = || Pixels::Srgb8(vec![[1, 2, 3, 255]; 2]);
        assert_eq!(refusal(NARROW, &photo(opaque(), vec![false, false], vec![])), "");
        let masked = photo(opaque(), vec![true, false], vec![]);
        assert!(refusal(NARROW, &masked).contains("found 1 ignored"), "{}", refusal(NARROW, &masked));
        assert_eq!(refusal(Record { has_position: true, ..NARROW }, &masked), "");
        let transparent = photo(Pixels::Srgb8(vec![[1, 2, 3, 254]; 2]), vec![], vec![]);
        assert!(refusal(NARROW, &transparent).contains("found transparent pixels"));
        assert_eq!(refusal(Record { is_opaque: false, ..NARROW }, &transparent), "");
        let deep = photo(Pixels::Srgb16(vec![[9; 4]; 2]), vec![], vec![]);
        assert!(refusal(NARROW, &deep).contains("expected pixels of 8 bits a channel"));
        assert_eq!(refusal(Record { color: 2, is_opaque: false, ..NARROW }, &deep), "");
        let wide = Record { color: 4, is_opaque: false, ..NARROW };
        assert!(refusal(wide, &deep).contains("linear floats, as the scene's features say, found 16 bits"));
        assert_eq!(refusal(Record { color: 2, ..NARROW }, &photo(opaque(), vec![], vec![])), "");
    }

    #[test]
    fn photos_of_other_sizes_than_their_own_are_refused() {
        let pixels = |count| Pixels::Srgb8(vec![[255; 4]; count]);
        for odd in [
            photo(pixels(1), vec![], vec![]),
            photo(pixels(2), vec![false], vec![]),
            photo(pixels(2), vec![], vec![1.0; 3]),
        ] {
            assert!(refusal(NARROW, &odd).contains("expected 2 pixels of 2x1"), "{odd:?}");
        }
    }
}
