//! Measuring test views: a few of them while training, all of them at the end.

use super::scores::{Judge, Means, Score};
use super::train::setup::Setup;
use crate::remarks::Remarks;
use anyhow::Result;
use nerf::capture::dataset::{Dataset, evenly_spaced};
use nerf::field::Field;
use nerf::field::render::Renderer;
use nerf::photo::Photo;
use nerf::photo::color::ColorSpace;

/// Renders test views of a field in training and compares them, on black.
#[derive(Debug)]
pub(super) struct Exam<'a> {
    /// Renders and compares.
    pub(super) judge: Judge<'a>,
    /// All test frames.
    pub(super) test: Vec<usize>,
    /// Some of them, evenly spaced, with their photos.
    few: Vec<(usize, Photo)>,
}

/// The scores of all test views, and of the few among them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Marks {
    /// Of all views.
    pub(super) all: Means,
    /// Of those that were measured while training; `None` if there are none.
    pub(super) few: Option<Means>,
}

impl<'a> Exam<'a> {
    /// A renderer of the field, and the photos of up to `few` views. `None` without test views.
    pub(super) fn new(
        setup: &Setup,
        field: &Field,
        dataset: &'a Dataset,
        few: usize,
    ) -> Result<Option<Self>> {
        if setup.test.is_empty() {
            return Ok(None);
        }
        let needs = &setup.about.needs;
        let renderer = Renderer::new(field, &needs.lenses)?;
        let color_space = ColorSpace::of(needs.hdr);
        let judge = Judge::new(renderer, color_space, dataset);
        let few = evenly_spaced(&setup.test, few);
        let mut photos = Vec::with_capacity(few.len());
        dataset.stream(&few, false, &mut |position, photo| {
            if !photo.is_ignored() {
                photos.push((few[position], photo));
            }
            Ok(())
        })?;
        let few = photos;
        Ok(Some(Self { judge, test: setup.test.clone(), few }))
    }

    /// Measures the few; `None` if there are none.
    pub(super) fn few(&mut self) -> Result<Option<Means>> {
        let mut scores = Vec::with_capacity(self.few.len());
        for (index, photo) in &self.few {
            scores.push(self.judge.compare(*index, photo)?.score);
        }
        Ok(Means::of(&scores))
    }

    /// Measures all.
    pub(super) fn all(&mut self, remarks: Remarks) -> Result<Option<Marks>> {
        let mut scores = Vec::with_capacity(self.test.len());
        self.judge.each(&self.test, None, remarks, |_, compared| {
            scores.push(compared.score);
            Ok(())
        })?;
        let frames = &self.judge.dataset.frames;
        let is_one_of_few = |score: &&Score| self.few.iter().any(|&(few, _)| frames[few].name == score.file);
        let few: Vec<Score> = scores.iter().filter(is_one_of_few).cloned().collect();
        Ok(Means::of(&scores).map(|all| Marks { all, few: Means::of(&few) }))
    }
}
