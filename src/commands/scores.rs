//! Measuring rendered views against photos.

use crate::progress::Progress;
use crate::remarks::Remarks;
use anyhow::Result;
use nerf::dataset::{Dataset, Photo};
use nerf::metrics::{filled, psnr_where, ssim};
use nerf::picture::{ColorSpace, photo_over};
use nerf::render::Renderer;
use serde::Serialize;

/// How well one view is rendered.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Score {
    /// The frame's name.
    pub(super) file: String,
    /// In decibels, over all channels of the pixels that no mask ignores.
    pub(super) psnr: f64,
    /// Structural similarity.
    pub(super) ssim: f64,
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
}

impl Means {
    /// The means of some scores; `None` of none.
    pub(super) fn of(scores: &[Score]) -> Option<Self> {
        let mean = |value: fn(&Score) -> f64| scores.iter().map(value).sum::<f64>() / scores.len() as f64;
        let means = Self { psnr: mean(|s| s.psnr), ssim: mean(|s| s.ssim), views: scores.len() };
        (!scores.is_empty()).then_some(means)
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
}

impl Judge<'_> {
    /// Renders frame `index` and compares it with its photo, where the photo's pixels count.
    pub(super) fn compare(&mut self, index: usize, photo: &Photo) -> Result<Compared> {
        let frame = &self.dataset.frames[index];
        let view = self.renderer.render(&frame.camera)?;
        let rendered = self.color_space.over(&view.color, self.background);
        let target = photo_over(&photo.image, self.background);
        let (width, height) = (view.width as usize, view.height as usize);
        let score = Score {
            file: frame.name.clone(),
            psnr: psnr_where(&rendered, &target, &photo.ignored),
            ssim: ssim(&filled(&rendered, &target, &photo.ignored), &target, width, height),
            ignored: Some(photo.count_ignored()).filter(|&count| count > 0),
            saved: None,
        };
        Ok(Compared { score, size: [view.width, view.height], rendered, photo: target })
    }

    /// Renders frames one after the other, whose photos are decoded for it, and hands over what it compared.
    pub(super) fn each(
        &mut self,
        indices: &[usize],
        remarks: Remarks,
        mut take: impl FnMut(Compared) -> Result<()>,
    ) -> Result<()> {
        let progress = Progress::new(remarks, "measuring");
        let dataset = self.dataset;
        dataset.stream(indices, false, &mut |position, photo| {
            let index = indices[position];
            if photo.is_ignored() {
                let name = &dataset.frames[index].name;
                progress.say(&format!("warning: {name} is not measured: its mask ignores every pixel"));
            } else {
                take(self.compare(index, &photo)?)?;
            }
            progress.count(position + 1, indices.len(), "views");
            Ok(())
        })
    }
}
