//! How photos are read: what their alpha means, and which part of them is used at which size.

use std::fmt;

use anyhow::{Result, bail, ensure};
use serde::{Deserialize, Serialize};

use super::Window;
use crate::support::remedy::{Advised, Remedy};

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

impl Reading {
    /// The part of an image of `size` that is used, and the size in pixels that it is reduced to: the nearest
    /// whole numbers to width and height over `downscale`, at least 1.
    pub(crate) fn part(&self, size: [u32; 2]) -> Result<(Window, [u32; 2])> {
        let Crop { left, top, right, bottom } = self.crop;
        let rest =
            |all: u32, cut: [u32; 2]| all.checked_sub(cut[0].checked_add(cut[1])?).filter(|&rest| rest > 0);
        let rest = rest(size[0], [left, right]).zip(rest(size[1], [top, bottom]));
        ensure!(
            rest.is_some() && self.downscale > 0,
            "the crop {} leaves nothing of {}x{} pixels at 1/{}; crop less",
            self.crop,
            size[0],
            size[1],
            self.downscale
        );
        let kept = rest.map_or(size, |(width, height)| [width, height]);
        if kept.iter().any(|&side| side < self.downscale) {
            let [width, height] = kept;
            let left = format!(" leaves less than a pixel of {width}x{height}; divide by less");
            bail!(Advised::new("", Remedy::Downscale(self.downscale), left));
        }
        let reduced = |side: u32| {
            let nearest = (u64::from(side) + u64::from(self.downscale) / 2) / u64::from(self.downscale);
            nearest.max(1) as u32
        };
        Ok((Window { corner: [left, top], size: kept }, kept.map(reduced)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_cropped_before_they_are_reduced() {
        let crop = Crop { left: 1, top: 2, right: 3, bottom: 0 };
        let reading = Reading { downscale: 3, crop, ..Reading::default() };
        let (window, size) = reading.part([14, 13]).expect("something is left");
        assert_eq!(window, Window { corner: [1, 2], size: [10, 11] });
        assert_eq!(size, [3, 4]);
        assert_eq!(reading.part([7, 6]).expect("a pixel").1, [1, 1]);
        assert!(
            reading.part([7, 4]).expect_err("too little").to_string().contains("less than a pixel of 3x2")
        );
        let message = reading.part([4, 13]).expect_err("nothing left").to_string();
        assert!(message.contains("1,2,3,0 leaves nothing of 4x13"), "{message}");
        let (window, size) = Reading::default().part([7, 9]).expect("everything");
        assert_eq!((window.corner, window.size, size), ([0, 0], [7, 9], [7, 9]));
    }

    #[test]
    fn a_checkpoint_can_keep_it() {
        let reading = Reading { max_images: Some(7), alpha: AlphaMode::Premultiplied, ..Reading::default() };
        let text = serde_json::to_string(&reading).expect("serialises");
        assert!(text.contains("\"alpha\":\"premultiplied\""), "{text}");
        assert_eq!(serde_json::from_str::<Reading>(&text).expect("parses"), reading);
    }
}
