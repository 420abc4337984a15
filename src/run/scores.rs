//! How well views are rendered: one by one, and on average.

use super::depths::Depths;
use super::report::test_views::ViewScores;
use serde::{Serialize, Serializer};

/// How well one view is rendered.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Score {
    /// The frame's name.
    pub file: String,
    /// In decibels, over all channels of the pixels that no mask ignores.
    pub psnr: f64,
    /// Structural similarity.
    pub ssim: f64,
    /// How far away lies what it shows, if the cameras have a focus to measure it by; serialised as its near share.
    #[serde(rename = "near_share", serialize_with = "near_share")]
    pub depths: Option<Depths>,
    /// Number of pixels that masks ignore, if there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ignored: Option<usize>,
    /// The file the rendering was saved to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub saved: Option<String>,
}

impl Score {
    /// What the page about a run shows of it.
    pub(super) fn for_page(&self) -> ViewScores {
        let Self { file, psnr, ssim, depths, .. } = self.clone();
        ViewScores { name: file, psnr, ssim, depths }
    }
}

fn near_share<S: Serializer>(depths: &Option<Depths>, to: S) -> Result<S::Ok, S::Error> {
    depths.as_ref().and_then(Depths::near_share).serialize(to)
}

/// Means over views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Means {
    /// Mean of the views' PSNRs, in decibels.
    pub psnr: f64,
    /// Mean of the views' SSIMs.
    pub ssim: f64,
    /// Number of views.
    pub views: usize,
    /// Part of all their pixels with a surface right before the camera.
    pub near_share: Option<f64>,
}

impl Means {
    /// The means of some scores; `None` of none.
    #[must_use]
    pub fn of(scores: &[Score]) -> Option<Self> {
        let mean = |value: fn(&Score) -> f64| scores.iter().map(value).sum::<f64>() / scores.len() as f64;
        let near_share = scores.iter().filter_map(|score| score.depths.as_ref()).sum::<Depths>().near_share();
        let means = Self { psnr: mean(|s| s.psnr), ssim: mean(|s| s.ssim), views: scores.len(), near_share };
        (!scores.is_empty()).then_some(means)
    }
}

/// The scores of all test views, and of the few among them that were measured while training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scores {
    /// Of all views.
    pub all: Means,
    /// Of the few; `None` if there are none.
    pub few: Option<Means>,
}
