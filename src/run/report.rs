//! The page about a training run: one HTML file that needs neither network nor script.
//!
//! Data in, text out: the rows of a run's log ([`log`](super::log)), the scores of the test views and small pictures of some of
//! them ([`test_views`], [`pictures`]) become curves, tables and images in one page.

mod colormap;
mod curves;
mod distances;
mod measure;
mod page;
pub mod pictures;
pub mod test_views;
mod time;

use crate::field::checkpoint::Metadata;
use crate::run::log::Log;
use crate::support::file::write_atomically;
use anyhow::{Context, Result};
use std::io::Write;
use std::path::Path;
use std::time::SystemTime;
use test_views::{ScoreSummary, TestViews};

/// What is known about a training run; everything may be missing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// The folder of the run.
    pub run: String,
    /// The dataset as it was named.
    pub dataset: Option<String>,
    /// When the checkpoint was written.
    pub trained: Option<SystemTime>,
    /// The adapter trained on.
    pub adapter: Option<String>,
    /// Steps taken.
    pub steps: Option<u64>,
    /// Seconds of training.
    pub seconds: Option<f64>,
    /// Whether the run has reached the end it was given.
    pub is_done: Option<bool>,
    /// Number of views trained on.
    pub train_views: Option<usize>,
    /// Whether the field holds linear light.
    pub hdr: bool,
    /// The resolved settings, as JSON.
    pub settings: Option<String>,
}

impl Facts {
    /// What a checkpoint's metadata says about the run in `folder`, at its step and seconds.
    ///
    /// # Errors
    /// Never for settings that were read or resolved.
    pub fn of(folder: &Path, metadata: &Metadata) -> Result<Self> {
        Ok(Self {
            run: folder.display().to_string(),
            dataset: Some(metadata.dataset.clone()),
            trained: None,
            adapter: Some(metadata.adapter.clone()),
            steps: Some(u64::from(metadata.step)),
            seconds: Some(metadata.seconds),
            is_done: Some(metadata.budget.is_spent(metadata.step, metadata.seconds)),
            train_views: Some(metadata.splits.train.len()),
            hdr: metadata.features.hdr,
            settings: Some(serde_json::to_string_pretty(&metadata.config)?),
        })
    }
}

/// A training run to write about.
#[derive(Clone, Debug)]
pub struct Report {
    /// What is known about it.
    pub facts: Facts,
    /// Its log.
    pub log: Log,
    /// Its test views, or why they are not shown.
    pub views: Result<TestViews, String>,
}

impl Report {
    /// The page.
    ///
    /// # Errors
    /// When a chart cannot be drawn.
    pub fn html(&self) -> Result<String> {
        page::page(self)
    }

    /// Writes the page to a file.
    ///
    /// # Errors
    /// When a chart cannot be drawn, or the file cannot be written.
    pub fn save(&self, out: &Path) -> Result<()> {
        let html = self.html()?;
        write_atomically(out, |file| Ok(file.write_all(html.as_bytes())?))
            .context("the report was not written")
    }

    /// What the test views say of the field as it was left: as measured for this page, else as logged at its last
    /// step.
    #[must_use]
    pub fn summary(&self) -> Option<ScoreSummary> {
        let measured = self.views.as_ref().ok().and_then(TestViews::summary);
        let logged = || {
            let row = self.log.result().filter(|row| self.steps().is_none_or(|steps| steps == row.step))?;
            Some(ScoreSummary {
                psnr: row.eval_psnr?,
                ssim: row.eval_ssim?,
                views: row.views,
                left_out: row.views_left_out.unwrap_or(0),
                near_share: row.near_share,
            })
        };
        measured.or_else(logged)
    }

    /// Steps taken.
    #[must_use]
    pub fn steps(&self) -> Option<u64> {
        self.facts.steps.or_else(|| Some(self.log.steps.last()?.step))
    }

    /// Seconds of training.
    #[must_use]
    pub fn seconds(&self) -> Option<f64> {
        self.facts.seconds.or_else(|| self.log.steps.last()?.seconds)
    }
}
