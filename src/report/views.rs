//! The scores of the test views, and pictures of some of them.

use super::pictures::Pictures;
use anyhow::Result;

/// TestViews with pictures: evenly spaced ones …
pub const EVENLY_SPACED: usize = 8;
/// … and the worst.
pub const WORST: usize = 4;

/// Scored views, in the order of the dataset; a few of them with pictures.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TestViews {
    rows: Vec<Row>,
    /// Number of views that there will be.
    expected: usize,
    /// Names of views that could not be found.
    pub missing: Vec<String>,
}

/// How well one view is rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The view's name.
    pub name: String,
    /// In decibels.
    pub psnr: f64,
    /// Structural similarity.
    pub ssim: f64,
    /// What it looks like.
    pub pictures: Option<Pictures>,
    is_spaced: bool,
}

impl TestViews {
    /// No view yet of `expected` ones.
    #[must_use]
    pub fn new(expected: usize) -> Self {
        Self { expected, ..Self::default() }
    }

    /// Adds the next view. Its pictures are made only if it is one of the evenly spaced or of the worst so far,
    /// and kept only as long as it is.
    ///
    /// # Errors
    /// When the pictures cannot be made.
    pub fn add(
        &mut self,
        name: &str,
        [psnr, ssim]: [f64; 2],
        pictures: impl FnOnce() -> Result<Pictures>,
    ) -> Result<()> {
        let number = self.rows.len();
        let count = EVENLY_SPACED.min(self.expected);
        let is_spaced = (0..count).any(|i| i * self.expected / count == number);
        self.rows.push(Row { name: name.to_owned(), psnr, ssim, pictures: None, is_spaced });
        let worst: Vec<usize> = self.by_score().into_iter().take(WORST).collect();
        if is_spaced || worst.contains(&number) {
            self.rows[number].pictures = Some(pictures()?);
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

    /// Mean PSNR in decibels, and mean SSIM; `None` without views.
    #[must_use]
    pub fn means(&self) -> Option<[f64; 2]> {
        let mean = |value: fn(&Row) -> f64| self.rows.iter().map(value).sum::<f64>() / self.rows.len() as f64;
        (!self.rows.is_empty()).then(|| [mean(|row| row.psnr), mean(|row| row.ssim)])
    }

    fn by_score(&self) -> Vec<usize> {
        let mut order: Vec<_> = (0..self.rows.len()).collect();
        order.sort_by(|&a, &b| self.rows[a].psnr.total_cmp(&self.rows[b].psnr));
        order
    }
}
