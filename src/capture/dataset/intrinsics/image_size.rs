//! Image sizes as files state them, and lengths in pixels of an image of some size.

use anyhow::{Result, ensure};
use glam::DVec2;

use crate::capture::dataset::json::{Fields, REMEDY};
use crate::capture::diagnostics::{Diagnostic, Severity};

/// Width and height in pixels as far as they are known; may be fractional.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ImageSize {
    width: Option<f64>,
    height: Option<f64>,
    origin: Origin,
}

/// How a size came to be known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Origin {
    /// Written in the file.
    #[default]
    Declared,
    /// The one that focal length and field of view agree on.
    Angles,
    /// The one that the principal point is the middle of.
    Center,
}

impl ImageSize {
    pub(super) fn read(fields: Fields) -> Result<Self> {
        let mut known = Self::default();
        for (width, height) in [("w", "h"), ("width", "height"), ("image_width", "image_height")] {
            let (width, height) = (fields.positive(width, 1e6)?, fields.positive(height, 1e6)?);
            let least = width.unwrap_or(1.0).min(height.unwrap_or(1.0));
            ensure!(least >= 1.0, "`w` and `h` must be at least 1 pixel, found {least}; {REMEDY}");
            known = known.or(Self { width, height, origin: Origin::Declared });
        }
        Ok(known)
    }

    pub(super) fn implied(width: Option<f64>, height: Option<f64>) -> Self {
        Self { width, height, origin: Origin::Angles }
    }

    /// Itself, with what it does not know from another.
    pub(super) fn or(self, other: Self) -> Self {
        if self.width.is_none() && self.height.is_none() {
            return other;
        }
        // An implied side would not be the other side of a declared one.
        if other.origin != self.origin {
            return self;
        }
        Self { width: self.width.or(other.width), height: self.height.or(other.height), origin: self.origin }
    }

    pub(super) fn or_guess(self, guess: Option<DVec2>) -> Self {
        match guess {
            Some(size) => self.or(Self { width: Some(size.x), height: Some(size.y), origin: Origin::Center }),
            None => self,
        }
    }

    pub(super) fn both(self) -> Option<DVec2> {
        Some(DVec2::new(self.width?, self.height?))
    }

    /// The whole size, an unknown side by the aspect of an image.
    fn beside(self, image: DVec2) -> Option<DVec2> {
        let aspect = image.x / image.y;
        match (self.width, self.height) {
            (Some(width), Some(height)) => Some(DVec2::new(width, height)),
            (Some(width), None) => Some(DVec2::new(width, width / aspect)),
            (None, Some(height)) => Some(DVec2::new(height * aspect, height)),
            (None, None) => None,
        }
    }
}

/// A length in pixels of an image of some size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measure {
    pub(super) px: DVec2,
    pub(super) size: ImageSize,
}

impl Measure {
    /// The length in pixels of an image of this size, and what is to be said where that differs.
    pub(super) fn at(self, actual: DVec2) -> (DVec2, Option<Diagnostic>) {
        let Some(size) = self.size.beside(actual) else {
            return (self.px, None);
        };
        // Exporters round sizes, and some write fractional ones; angles are rounded more coarsely.
        let tolerance = match self.size.origin {
            Origin::Declared => DVec2::ONE,
            Origin::Angles | Origin::Center => 0.01 * actual + 1.0,
        };
        if (size - actual).abs().cmplt(tolerance).all() {
            return (self.px, None);
        }
        (self.px * actual / size, Some(self.size.origin.remark(size, actual)))
    }

    /// For a principal point without `w` and `h`: the size that it is the middle of, where that has the
    /// aspect of the image and is too far from its size to be a matter of the lens.
    pub(super) fn guessed_size(self, actual: DVec2) -> Option<DVec2> {
        let ratio = 2.0 * self.px / actual;
        let factor = (ratio.x * ratio.y).sqrt();
        let is_same_aspect = ratio.min_element() > 0.0 && (ratio.x / ratio.y - 1.0).abs() < 0.05;
        if self.size.beside(actual).is_some() || !is_same_aspect || (factor - 1.0).abs() < 0.2 {
            return None;
        }
        // Images are mostly shrunk by whole numbers.
        let whole = if factor > 1.0 { factor.round() } else { factor.recip().round().recip() };
        let is_whole = (whole / factor - 1.0).abs() < 0.05 && whole != 1.0;
        Some(actual * if is_whole { whole } else { factor })
    }
}

impl Origin {
    fn remark(self, from: DVec2, actual: DVec2) -> Diagnostic {
        let ratio = actual / from;
        let source = match self {
            Self::Declared => "the file's intrinsics belong to",
            Self::Angles => "without `w` and `h`, focal length and field of view agree on",
            Self::Center => "without `w` and `h`, the principal point is the middle of",
        };
        let rounded = |size: DVec2| format!("{}x{}", two_decimals(size.x), two_decimals(size.y));
        let mut message =
            format!("{source} {} pixels, the image has {}; they were scaled", rounded(from), rounded(actual));
        let has_aspect = |ratio: DVec2| (ratio.x / ratio.y - 1.0).abs() <= 0.02;
        let mut severity = if self == Self::Declared { Severity::Note } else { Severity::Warning };
        if !has_aspect(ratio) {
            severity = Severity::Warning;
            message += if has_aspect(actual / DVec2::new(from.y, from.x)) {
                "; width and height are swapped: the image was rotated after the cameras were found, so turn it \
                 back"
            } else {
                "; the aspect ratios differ, so the image may be cropped or rotated and the cameras wrong"
            };
        }
        Diagnostic::new(severity, message)
    }
}

fn two_decimals(number: f64) -> f64 {
    (number * 100.0).round() / 100.0
}
