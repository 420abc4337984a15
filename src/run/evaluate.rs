//! Test views rendered and compared with their photos.

use super::depths::{Depths, Onlookers, median_depth};
use super::event::{Event, Observer, Warning};
use super::scores::{Means, Score, Scores};
use crate::capture::dataset::Dataset;
use crate::field::renderer::Renderer;
use crate::photo::Photo;
use crate::photo::color_space::{ColorSpace, photo_over};
use crate::support::metrics::{filled, psnr_where, ssim};
use anyhow::Result;
use std::time::Instant;

/// Renders frames of a dataset and compares them with their photos.
#[derive(Debug)]
pub struct Evaluator<'a> {
    /// What is behind photo and rendering, display-referred.
    pub background: [f32; 3],
    /// Samples per pixel of a rendering.
    pub samples: u32,
    renderer: Renderer,
    /// The field's colour space.
    color_space: ColorSpace,
    /// Where the photos are.
    dataset: &'a Dataset,
    /// The dataset's cameras, if they look at one point.
    onlookers: Option<Onlookers>,
    /// Frames whose photos are kept, to be measured again and again.
    kept: Vec<(usize, Photo)>,
}

/// A rendered view beside its photo.
#[derive(Debug)]
pub struct Compared {
    /// How alike they are.
    pub score: Score,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// The rendering, display-referred.
    pub rendered: Vec<[f32; 3]>,
    /// The photo, display-referred.
    pub photo: Vec<[f32; 3]>,
    /// Where masks ignore the photo; empty where they do so nowhere.
    pub ignored: Vec<bool>,
    /// The rendering's depth, in world units.
    pub depth: Vec<f32>,
    /// Distance from the camera to the scene's focus, else the median depth; in world units.
    pub unit: f64,
}

impl<'a> Evaluator<'a> {
    /// A renderer beside photos, on black.
    #[must_use]
    pub fn new(renderer: Renderer, color_space: ColorSpace, dataset: &'a Dataset) -> Self {
        let onlookers = Onlookers::of(dataset);
        Self { background: [0.0; 3], samples: 1, renderer, color_space, dataset, onlookers, kept: Vec::new() }
    }

    /// Renders frame `index` and compares it with its photo, where the photo's pixels count.
    ///
    /// # Errors
    /// When the device was lost, or its interrupt was raised.
    pub fn compare(&mut self, index: usize, photo: &Photo) -> Result<Compared> {
        let frame = &self.dataset.frames[index];
        let view = self.renderer.render_sampled(&frame.camera, self.samples)?;
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
        let ignored = photo.ignored.clone();
        Ok(Compared { score, size, rendered, photo: target, ignored, depth: view.depth, unit })
    }

    /// Renders frames one after the other, whose photos are decoded for it, and hands over what it compared, with the
    /// position in `indices`. Stops before it would take longer than `limit` seconds, but not before the first; how
    /// many frames it came to.
    ///
    /// # Errors
    /// When a photo cannot be read, the device was lost or its interrupt raised, or `take` fails.
    pub fn each(
        &mut self,
        indices: &[usize],
        limit: Option<f64>,
        observer: &mut dyn Observer,
        mut take: impl FnMut(usize, Compared) -> Result<()>,
    ) -> Result<usize> {
        let (clock, dataset) = (Instant::now(), self.dataset);
        let all = indices.len();
        let (mut done, mut measured) = (0, 0);
        observer.notice(&Event::Measuring { done, all });
        loop {
            let count = affordable(limit, clock.elapsed().as_secs_f64(), measured, all - done);
            if count == 0 {
                return Ok(done);
            }
            dataset.stream(&indices[done..done + count], false, &mut |number, photo| {
                let position = done + number;
                let index = indices[position];
                if photo.is_ignored() {
                    let name = &dataset.frames[index].name;
                    observer.notice(&Event::Warning(Warning::NotMeasured { name }));
                } else {
                    take(position, self.compare(index, &photo)?)?;
                    measured += 1;
                }
                observer.notice(&Event::Measuring { done: position + 1, all });
                Ok(())
            })?;
            done += count;
        }
    }

    /// Decodes the photos of some frames and keeps them for [`Evaluator::kept`]; those that masks ignore are left out.
    ///
    /// # Errors
    /// When a photo cannot be read.
    pub fn keep(&mut self, indices: &[usize]) -> Result<()> {
        self.kept.clear();
        self.dataset.stream(indices, false, &mut |position, photo| {
            if !photo.is_ignored() {
                self.kept.push((indices[position], photo));
            }
            Ok(())
        })
    }

    /// Measures the frames whose photos are kept; `None` if there are none.
    ///
    /// # Errors
    /// When the device was lost, or its interrupt was raised.
    pub fn kept(&mut self) -> Result<Option<Means>> {
        let kept = std::mem::take(&mut self.kept);
        let scores: Result<Vec<_>> =
            kept.iter().map(|(index, photo)| Ok(self.compare(*index, photo)?.score)).collect();
        self.kept = kept;
        Ok(Means::of(&scores?))
    }

    /// Measures all of some frames, and tells those apart whose photos are kept. `None` where there is nothing to
    /// measure.
    ///
    /// # Errors
    /// As [`Evaluator::each`].
    pub fn all(&mut self, indices: &[usize], observer: &mut dyn Observer) -> Result<Option<Scores>> {
        let mut scores = Vec::with_capacity(indices.len());
        self.each(indices, None, observer, |_, compared| {
            scores.push(compared.score);
            Ok(())
        })?;
        let frames = &self.dataset.frames;
        let is_kept = |score: &&Score| self.kept.iter().any(|&(kept, _)| frames[kept].name == score.file);
        let few: Vec<Score> = scores.iter().filter(is_kept).cloned().collect();
        Ok(Means::of(&scores).map(|all| Scores { all, few: Means::of(&few) }))
    }
}

/// How many views to render next, of `left` ones, where `done` ones have taken `seconds` of `limit`: the first one
/// always; later as many as fit, but at most as many as there are.
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
