//! The scores of the test views, and pictures of some of them.

use super::pictures::Pictures;
use crate::run::depths::Depths;
use crate::support::format::count;
use anyhow::Result;

/// Views with pictures: evenly spaced ones …
pub const EVENLY_SPACED: usize = 8;
/// … and the worst.
pub const WORST: usize = 4;

/// Scored views, in the order of the dataset; a few of them with pictures.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TestViews {
    rows: Vec<Row>,
    /// Names of views that could not be found.
    pub missing: Vec<String>,
    /// Number of views that were not measured, because it would have taken too long.
    pub left_out: usize,
}

/// How well a view is rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewScores {
    /// The view's name.
    pub name: String,
    /// In decibels.
    pub psnr: f64,
    /// Structural similarity.
    pub ssim: f64,
    /// How far away lies what it shows; `None` where the cameras have no focus to measure it by.
    pub depths: Option<Depths>,
}

/// One view.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// How well it is rendered.
    pub scores: ViewScores,
    /// What it looks like.
    pub pictures: Option<Pictures>,
    /// Its place in the dataset.
    position: usize,
    is_spaced: bool,
}

/// What test views say together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoreSummary {
    /// Mean of the views' PSNRs, in decibels.
    pub psnr: f64,
    /// Mean of the views' SSIMs.
    pub ssim: f64,
    /// Number of views measured.
    pub views: u64,
    /// Number of views that were not measured, because it would have taken too long.
    pub left_out: u64,
    /// Part of all pixels that [`Depths::near_share`] counts; `None` where the cameras have no focus to measure it by.
    pub near_share: Option<f64>,
}

impl ScoreSummary {
    /// `7 test views`, or `4 of 7 test views`.
    #[must_use]
    pub fn measured(&self) -> String {
        let all = count((self.views + self.left_out) as usize, "test view");
        if self.left_out > 0 { format!("{} of {all}", self.views) } else { all }
    }
}

impl TestViews {
    /// Adds the view at `position` in the dataset. Its pictures are made only if it is one of the evenly spaced or of
    /// the worst so far, and kept only as long as it is. The first [`EVENLY_SPACED`] that are added count as evenly
    /// spaced, which they are in a [`spread_order`](crate::capture::dataset::spread_order).
    ///
    /// # Errors
    /// When the pictures cannot be made.
    pub fn add(
        &mut self,
        position: usize,
        scores: ViewScores,
        pictures: impl FnOnce() -> Result<Pictures>,
    ) -> Result<()> {
        let is_spaced = self.rows.len() < EVENLY_SPACED;
        let place = self.rows.partition_point(|row| row.position < position);
        self.rows.insert(place, Row { scores, pictures: None, position, is_spaced });
        let worst: Vec<usize> = self.by_score().into_iter().take(WORST).collect();
        if is_spaced || worst.contains(&place) {
            self.rows[place].pictures = Some(pictures()?);
        }
        for (index, row) in self.rows.iter_mut().enumerate() {
            if !row.is_spaced && !worst.contains(&index) {
                row.pictures = None;
            }
        }
        Ok(())
    }

    /// The views, the worst first.
    #[must_use]
    pub fn worst_first(&self) -> Vec<&Row> {
        self.by_score().into_iter().map(|index| &self.rows[index]).collect()
    }

    /// Number of views.
    #[must_use]
    pub fn count(&self) -> usize {
        self.rows.len()
    }

    /// What they say together; `None` without views.
    #[must_use]
    pub fn summary(&self) -> Option<ScoreSummary> {
        let scores = || self.rows.iter().map(|row| &row.scores);
        let mean = |value: fn(&ViewScores) -> f64| scores().map(value).sum::<f64>() / self.rows.len() as f64;
        (!self.rows.is_empty()).then(|| ScoreSummary {
            psnr: mean(|view| view.psnr),
            ssim: mean(|view| view.ssim),
            views: self.rows.len() as u64,
            left_out: self.left_out as u64,
            near_share: self.depths().and_then(|depths| depths.near_share()),
        })
    }

    /// How far away lies what the views show; `None` where that is known of none.
    #[must_use]
    pub fn depths(&self) -> Option<Depths> {
        let told: Vec<&Depths> = self.rows.iter().filter_map(|row| row.scores.depths.as_ref()).collect();
        (!told.is_empty()).then(|| told.into_iter().sum())
    }

    fn by_score(&self) -> Vec<usize> {
        let mut order: Vec<_> = (0..self.rows.len()).collect();
        order.sort_by(|&a, &b| self.rows[a].scores.psnr.total_cmp(&self.rows[b].scores.psnr));
        order
    }
}
