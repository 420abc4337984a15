//! What the masks of all photos ignore, and whether that can be meant.

use super::super::{Diagnostic, Spread};
use super::{Gallery, Look};
use crate::capture::dataset::Dataset;
use crate::capture::diagnostics::{Severity, nothing_counts};
use crate::photo::Photo;
use crate::support::format::{count, percent};
use crate::support::remedy::{Advised, Remedy};
use std::collections::HashSet;

/// Masks that ignore more than this part of the middle of the pictures,
const MUCH_OF_MIDDLE: f64 = 0.6;
/// and of what is around it not so much more as this, ignore what the photos were taken of.
const MORE_AROUND: f64 = 0.1;

/// Parts of a photo that masks ignore.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Ignored {
    /// Of all pixels.
    pub(super) all: f64,
    /// Of those in the middle third of both sides.
    middle: f64,
}

impl Ignored {
    pub(super) fn of(photo: &Photo) -> Self {
        let [width, height] = photo.image.size().map(|side| side as usize);
        if photo.ignored.is_empty() {
            return Self::default();
        }
        let part = |[left, right]: [usize; 2], [top, bottom]: [usize; 2]| {
            let rows = photo.ignored.chunks_exact(width).take(bottom).skip(top);
            let ignored = rows.flat_map(|row| &row[left..right]).filter(|ignored| **ignored).count();
            ignored as f64 / ((right - left) * (bottom - top)) as f64
        };
        let middle = |side: usize| [side / 3, side - side / 3];
        Self { all: part([0, width], [0, height]), middle: part(middle(width), middle(height)) }
    }

    /// Of what is around the middle, which is a ninth of all.
    fn around(self) -> f64 {
        ((9.0 * self.all - self.middle) / 8.0).clamp(0.0, 1.0)
    }
}

impl Gallery {
    /// Which part of each photo masks ignore, of those with masks.
    #[must_use]
    pub fn ignored(&self, dataset: &Dataset) -> Spread {
        Spread::of(self.masked(dataset).map(|(_, look)| look.ignored.all))
    }

    /// Which part of all pixels masks ignore; `None` without photos.
    #[must_use]
    pub fn ignored_part(&self, dataset: &Dataset) -> Option<f64> {
        let pixels = |index: usize| {
            let camera = &dataset.frames[index].camera;
            f64::from(camera.width) * f64::from(camera.height)
        };
        let all: f64 = self.looks.iter().map(|(index, _)| pixels(*index)).sum();
        let ignored: f64 = self.looks.iter().map(|(index, look)| pixels(*index) * look.ignored.all).sum();
        (all > 0.0).then_some(ignored / all)
    }

    fn masked<'a>(&'a self, dataset: &'a Dataset) -> impl Iterator<Item = &'a (usize, Look)> {
        self.looks.iter().filter(|(index, _)| dataset.frames[*index].has_mask)
    }

    /// Whether masks leave nothing to train on.
    pub(super) fn leaves_nothing(&self, dataset: &Dataset) -> bool {
        let ignored: HashSet<usize> = self.which(|(_, look)| look.is_ignored).into_iter().collect();
        !dataset.train.is_empty() && dataset.train.iter().all(|index| ignored.contains(index))
    }

    /// What the masks as a whole can hardly be meant to do.
    pub(super) fn about_masks(&self, dataset: &Dataset) -> Option<Diagnostic> {
        let masked: Vec<&Look> = self.masked(dataset).map(|(_, look)| look).collect();
        let inverts = dataset.reading.invert_masks;
        if masked.is_empty() {
            return None;
        }
        if self.leaves_nothing(dataset) {
            let nothing = nothing_counts(dataset.train.len(), inverts);
            return Some(Diagnostic::from(nothing).about(dataset.train.clone()));
        }
        if masked.iter().all(|look| look.ignored.all == 0.0) {
            let what = match (inverts, dataset.frames.iter().any(|frame| frame.ignores_black())) {
                (false, true) => {
                    "what is to be ignored must be black, 0 in red, green and blue, and no pixel is"
                }
                (false, false) => "what is to be ignored must not be black, and every pixel is",
                (true, _) => "as they are inverted, every pixel of theirs says that it counts",
            };
            let photos = count(masked.len(), "photo");
            return Some(Diagnostic::warning(format!(
                "the masks of {photos} ignore nothing: {what}; export them again, or leave them out"
            )));
        }
        let mean = |part: fn(&Ignored) -> f64| {
            masked.iter().map(|look| part(&look.ignored)).sum::<f64>() / masked.len() as f64
        };
        let (middle, around) = (mean(|ignored| ignored.middle), mean(|ignored| ignored.around()));
        let remedy = if inverts { Remedy::LeaveMasks } else { Remedy::InvertMasks };
        (middle > MUCH_OF_MIDDLE && around < middle + MORE_AROUND).then(|| {
            let found = format!(
                "the masks ignore {} of the middle of the pictures, and {} of what is around it; if that is what the \
                 photos were taken of, the masks are inverted: ",
                percent(middle),
                percent(around)
            );
            Diagnostic::advise(Severity::Warning, Advised::new(found, remedy, ""))
        })
    }
}
