//! Measuring rendered views against photos.

use crate::progress::Progress;
use crate::remarks::Remarks;
use anyhow::Result;
use nerf::capture::dataset::Dataset;
use nerf::field::render::Renderer;
use nerf::photo::Photo;
use nerf::photo::color::{ColorSpace, photo_over};
use nerf::run::depths::{Depths, Onlookers, fog, median_depth};
use nerf::run::report::views::ViewScores;
use nerf::support::format::percent;
use nerf::support::metrics::{filled, psnr_where, ssim};
use serde::{Serialize, Serializer};
use std::time::Instant;

/// How well one view is rendered.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Score {
    /// The frame's name.
    pub(super) file: String,
    /// In decibels, over all channels of the pixels that no mask ignores.
    pub(super) psnr: f64,
    /// Structural similarity.
    pub(super) ssim: f64,
    /// How far away lies what it shows, if the cameras have a focus to tell it by.
    #[serde(rename = "near_share", serialize_with = "near_share")]
    pub(super) depths: Option<Depths>,
    /// Number of pixels that masks ignore, if there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) ignored: Option<usize>,
    /// The file the rendering was saved to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) saved: Option<String>,
}

impl Score {
    /// What is to be said of the number of pixels, if it is not the whole photo.
    pub(super) fn remark(&self) -> String {
        self.ignored.map_or(String::new(), |count| format!("  without {count} masked pixels"))
    }

    /// What the page about a training shows of it.
    pub(super) fn for_page(&self) -> ViewScores {
        let Self { file, psnr, ssim, depths, .. } = self.clone();
        ViewScores { name: file, psnr, ssim, depths }
    }
}

fn near_share<S: Serializer>(depths: &Option<Depths>, to: S) -> Result<S::Ok, S::Error> {
    depths.as_ref().and_then(Depths::near_share).serialize(to)
}

/// Means over views.
#[derive(Clone, Copy, Debug)]
pub(super) struct Means {
    /// Mean of the views' PSNRs.
    pub(super) psnr: f64,
    /// Mean of the views' SSIMs.
    pub(super) ssim: f64,
    /// Number of views.
    pub(super) views: usize,
    /// Part of all their pixels with a surface right before the camera.
    pub(super) near_share: Option<f64>,
}

impl Means {
    /// The means of some scores; `None` of none.
    pub(super) fn of(scores: &[Score]) -> Option<Self> {
        let mean = |value: fn(&Score) -> f64| scores.iter().map(value).sum::<f64>() / scores.len() as f64;
        let near_share = scores.iter().filter_map(|score| score.depths.as_ref()).sum::<Depths>().near_share();
        let means = Self { psnr: mean(|s| s.psnr), ssim: mean(|s| s.ssim), views: scores.len(), near_share };
        (!scores.is_empty()).then_some(means)
    }
}

/// A near share in a line of results.
pub(super) fn describe_near(share: Option<f64>) -> String {
    match share {
        Some(share) => format!("near share {}", percent(share)),
        None => "near share not told: the optical axes do not cross in one point".to_owned(),
    }
}

/// Warns where a near share looks like fog.
pub(super) fn warn_of_fog(share: Option<f64>, remarks: Remarks) {
    if let Some(fog) = share.and_then(fog) {
        remarks.warn(&fog);
    }
}

/// How many views to render next, of `left` ones, where `done` ones have taken `seconds` of `limit`: the first one
/// always; later as many as fit, but at most as many as there are to judge by.
fn affordable(limit: Option<f64>, seconds: f64, done: usize, left: usize) -> usize {
    match limit {
        None => left,
        Some(_) if done == 0 => left.min(1),
        Some(limit) => {
            let fitting = (limit - seconds) / (seconds / done as f64);
            left.min(done).min(fitting as usize)
        }
    }
}

/// Renders frames of a dataset and compares.
#[derive(Debug)]
pub(super) struct Judge<'a> {
    /// Renders the field.
    pub(super) renderer: Renderer,
    /// The field's colour space.
    pub(super) color_space: ColorSpace,
    /// What is behind photo and rendering, display-referred.
    pub(super) background: [f32; 3],
    /// Where the photos are.
    pub(super) dataset: &'a Dataset,
    /// The dataset's cameras, if they look at one point.
    onlookers: Option<Onlookers>,
}

/// A rendered view beside its photo.
#[derive(Debug)]
pub(super) struct Compared {
    /// How alike they are.
    pub(super) score: Score,
    /// Width and height in pixels.
    pub(super) size: [u32; 2],
    /// The rendering, display-referred.
    pub(super) rendered: Vec<[f32; 3]>,
    /// The photo, display-referred.
    pub(super) photo: Vec<[f32; 3]>,
    /// The rendering's depth, in world units.
    pub(super) depth: Vec<f32>,
    /// Distance from the camera to the scene's focus, else the median depth; in world units.
    pub(super) unit: f64,
}

impl<'a> Judge<'a> {
    /// A renderer beside photos, on black.
    pub(super) fn new(renderer: Renderer, color_space: ColorSpace, dataset: &'a Dataset) -> Self {
        let onlookers = Onlookers::of(dataset);
        Self { renderer, color_space, background: [0.0; 3], dataset, onlookers }
    }

    /// Renders frame `index` and compares it with its photo, where the photo's pixels count.
    pub(super) fn compare(&mut self, index: usize, photo: &Photo) -> Result<Compared> {
        let frame = &self.dataset.frames[index];
        let view = self.renderer.render(&frame.camera)?;
        let rendered = self.color_space.over(&view.color, self.background);
        let target = photo_over(&photo.image, self.background);
        let (width, height) = (view.width as usize, view.height as usize);
        let onlookers = self.onlookers.as_ref();
        let score = Score {
            file: frame.name.clone(),
            psnr: psnr_where(&rendered, &target, &photo.ignored),
            ssim: ssim(&filled(&rendered, &target, &photo.ignored), &target, width, height),
            depths: onlookers.map(|around| Depths::of(&view, &frame.camera, &photo.ignored, around)),
            ignored: Some(photo.count_ignored()).filter(|&count| count > 0),
            saved: None,
        };
        let unit = onlookers.map(|around| around.distance(&frame.camera));
        let unit = unit.unwrap_or_else(|| median_depth(&view.depth));
        let size = [view.width, view.height];
        Ok(Compared { score, size, rendered, photo: target, depth: view.depth, unit })
    }

    /// Renders frames one after the other, whose photos are decoded for it, and hands over what it compared, with the
    /// position in `indices`. Stops before it would take longer than `limit` seconds, but not before the first; how
    /// many frames it came to.
    pub(super) fn each(
        &mut self,
        indices: &[usize],
        limit: Option<f64>,
        remarks: Remarks,
        mut take: impl FnMut(usize, Compared) -> Result<()>,
    ) -> Result<usize> {
        let progress = Progress::new(remarks, "measuring");
        let (clock, dataset) = (Instant::now(), self.dataset);
        let mut done = 0;
        loop {
            let count = affordable(limit, clock.elapsed().as_secs_f64(), done, indices.len() - done);
            if count == 0 {
                return Ok(done);
            }
            dataset.stream(&indices[done..done + count], false, &mut |number, photo| {
                let position = done + number;
                let index = indices[position];
                if photo.is_ignored() {
                    let name = &dataset.frames[index].name;
                    progress.say(&format!("warning: {name} is not measured: its mask ignores every pixel"));
                } else {
                    take(position, self.compare(index, &photo)?)?;
                }
                progress.count(position + 1, indices.len(), "views");
                Ok(())
            })?;
            done += count;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Views that are measured of `all`, each of which takes `each` seconds.
    fn measured(limit: Option<f64>, each: f64, all: usize) -> usize {
        let mut done = 0;
        loop {
            match affordable(limit, each * done as f64, done, all - done) {
                0 => return done,
                count => done += count,
            }
        }
    }

    #[test]
    fn as_many_views_are_measured_as_there_is_time_for() {
        assert_eq!(measured(None, 100.0, 25), 25);
        assert_eq!(measured(Some(0.0), 1.0, 25), 1, "one in any case");
        assert_eq!(measured(Some(6.25), 0.5, 25), 12);
        assert_eq!(measured(Some(12.6), 0.5, 25), 25);
        assert_eq!(measured(Some(1e9), 0.0, 25), 25);
        assert_eq!(measured(Some(1.0), 1.0, 0), 0);
    }
}
