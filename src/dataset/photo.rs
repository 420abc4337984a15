//! A frame's pixels: its image, what masks say of it, and its depth.

use crate::image::Image;

/// One frame's pixels, at the size of its camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Photo {
    /// The image.
    pub image: Image,
    /// `true` where a mask says that the pixel tells nothing, `[height * width]`; empty where every pixel counts.
    pub ignored: Vec<bool>,
    /// Depth in world units, `[height * width]`, 0 where unknown; empty where the frame has none.
    pub depth: Vec<f32>,
}

impl From<Image> for Photo {
    fn from(image: Image) -> Self {
        Self { image, ignored: Vec::new(), depth: Vec::new() }
    }
}
