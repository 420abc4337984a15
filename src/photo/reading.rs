//! How photos are read: what their alpha means, and which part of them is used at which size.

use std::fmt;

use serde::{Deserialize, Serialize};

/// How photos are read. A checkpoint keeps it, so that photos are measured as they were trained on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reading {
    /// What the colours of files with alpha were multiplied with.
    pub alpha: AlphaMode,
    /// By how much width and height are divided, after the crop; 1 leaves them.
    pub downscale: u32,
    /// What is cut off.
    pub crop: Crop,
    /// Most frames to train on, evenly spaced; `None` for all.
    pub max_images: Option<usize>,
    /// Whether masks mean the opposite: white pixels are ignored (in dynamic masks, black ones).
    pub invert_masks: bool,
}

impl Default for Reading {
    fn default() -> Self {
        Self {
            alpha: AlphaMode::Auto,
            downscale: 1,
            crop: Crop::default(),
            max_images: None,
            invert_masks: false,
        }
    }
}

/// What the colours of files with alpha were multiplied with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AlphaMode {
    /// Found out when the dataset is opened: linear files are premultiplied by their standard, others straight
    /// by theirs, unless their pixels show that they are not.
    #[default]
    Auto,
    /// Nothing.
    Straight,
    /// Alpha.
    Premultiplied,
}

/// Pixels to cut off, counted in the image before it is reduced.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Crop {
    /// Columns on the left.
    pub left: u32,
    /// Rows at the top.
    pub top: u32,
    /// Columns on the right.
    pub right: u32,
    /// Rows at the bottom.
    pub bottom: u32,
}

impl fmt::Display for Crop {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{},{},{}", self.left, self.top, self.right, self.bottom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checkpoint_can_keep_it() {
        let reading = Reading { max_images: Some(7), alpha: AlphaMode::Premultiplied, ..Reading::default() };
        let text = serde_json::to_string(&reading).expect("serialises");
        assert!(text.contains("\"alpha\":\"premultiplied\""), "{text}");
        assert_eq!(serde_json::from_str::<Reading>(&text).expect("parses"), reading);
    }
}
