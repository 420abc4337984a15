//! Colours that stand for nothing, as files without alpha have them.

use crate::photo::{Image, Pixels};

/// Which pure colours are transparent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ColorKey {
    pub(crate) white: bool,
    pub(crate) black: bool,
}

impl ColorKey {
    /// The colours in words, if there are any.
    pub(crate) fn words(self) -> Option<&'static str> {
        match (self.white, self.black) {
            (false, false) => None,
            (true, false) => Some("white"),
            (false, true) => Some("black"),
            (true, true) => Some("white and black"),
        }
    }

    fn clear<T: Copy + PartialEq>(self, pixels: &mut [[T; 4]], [black, white]: [T; 2]) {
        for pixel in pixels {
            let is = |color: T| pixel[..3].iter().all(|&value| value == color);
            if (self.white && is(white)) || (self.black && is(black)) {
                *pixel = [black; 4];
            }
        }
    }
}

impl Image {
    /// The same image with these colours transparent; a linear one has none that are pure.
    pub(crate) fn keyed(mut self, key: ColorKey) -> Self {
        match &mut self.pixels {
            Pixels::Srgb8(pixels) => key.clear(pixels, [0, u8::MAX]),
            Pixels::Srgb16(pixels) => key.clear(pixels, [0, u16::MAX]),
            Pixels::Linear(_) => return self,
        }
        self.has_alpha |= key.words().is_some();
        self
    }
}
