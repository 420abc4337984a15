//! A trained field, from its checkpoint onto the device.

use super::Session;
use anyhow::Result;
use nerf::camera::LensKind;
use nerf::field;
use nerf::field::checkpoint::{self, About, Checkpoint};
use nerf::field::render::Renderer;
use nerf::gpu::Gpu;
use nerf::photo::color::ColorSpace;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A checkpoint that was read.
#[derive(Debug)]
pub(super) struct Field {
    /// The file.
    pub(super) path: PathBuf,
    /// What it is.
    pub(super) about: About,
    checkpoint: Checkpoint,
}

impl Field {
    /// Reads the checkpoint that `run` stands for; of its state, what rendering needs is kept.
    pub(super) fn load(run: &Path, session: &Session<'_>) -> Result<Self> {
        let path = checkpoint::locate(run)?;
        let checkpoint = Checkpoint::load(&path)?;
        let about = checkpoint.about.clone();
        session.remarks.detail(&format!(
            "{}: {} steps in {:.1} s on {}, trained on {}",
            path.display(),
            about.step,
            about.seconds,
            about.adapter,
            about.dataset
        ));
        Ok(Self { path, about, checkpoint })
    }

    /// The colour space of what it renders.
    pub(super) fn color_space(&self) -> ColorSpace {
        ColorSpace::of(self.about.needs.hdr)
    }

    /// A renderer of the field for cameras with `lenses`.
    pub(super) fn renderer(&self, gpu: &Arc<Gpu>, lenses: &BTreeSet<LensKind>) -> Result<Renderer> {
        Renderer::new(&field::Field::of(gpu, &self.checkpoint)?, lenses)
    }
}
