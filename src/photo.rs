//! Photos as plain values: pixels, masks, depth, and how they are to be read. No files.

pub mod color_space;
mod image;
mod reading;
mod split;

pub use image::{BitDepth, Image, Pixels};
pub use reading::{AlphaMode, Crop, Reading};
pub use split::Split;

/// One frame's pixels, at the size of its camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Photo {
    /// The picture.
    pub image: Image,
    /// `true` where a mask says to ignore the pixel, `[height * width]`; empty where every pixel counts.
    pub ignored: Vec<bool>,
    /// Depth in world units as the lens defines it (along the view axis for pinholes), `[height * width]`, 0
    /// where it is unknown; empty where the frame has none or it was not asked for.
    pub depth: Vec<f32>,
    /// Part of the values of the depth file that stand for far away, which is unknown: infinite, the largest number that
    /// the file can hold, or beyond the scene box by far.
    pub far_depth: f64,
}

impl Photo {
    /// Number of ignored pixels.
    pub fn count_ignored(&self) -> usize {
        self.ignored.iter().filter(|&&ignored| ignored).count()
    }

    /// Whether masks ignore every pixel: there is nothing to train on or to measure.
    pub fn is_ignored(&self) -> bool {
        !self.ignored.is_empty() && self.ignored.iter().all(|&ignored| ignored)
    }
}

impl From<Image> for Photo {
    fn from(image: Image) -> Self {
        Self { image, ignored: Vec::new(), depth: Vec::new(), far_depth: 0.0 }
    }
}
