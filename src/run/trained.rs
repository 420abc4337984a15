//! A trained field, from its checkpoint onto a device.

use crate::camera::LensKind;
use crate::field::Field;
use crate::field::checkpoint::{Checkpoint, Metadata, Opened};
use crate::field::parameters::Numbers;
use crate::field::renderer::Renderer;
use crate::gpu::Gpu;
use crate::photo::color_space::ColorSpace;
use crate::support::fingerprint::checksum;
use anyhow::Result;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

/// A checkpoint that was read.
#[derive(Debug)]
pub struct TrainedField {
    opened: Opened,
}

impl TrainedField {
    /// Reads the checkpoint that `run`, a folder or the file itself, stands for: in a folder the newest that can be used.
    ///
    /// # Errors
    /// When there is none, or none can be used.
    pub fn load(run: &Path) -> Result<Self> {
        Ok(Self { opened: Opened::of(run)? })
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.opened.path
    }

    /// That an earlier checkpoint was read, and why; `None` where the newest was.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        self.opened.warning()
    }

    /// What the checkpoint says about itself.
    #[must_use]
    pub fn metadata(&self) -> &Metadata {
        &self.opened.checkpoint.metadata
    }

    /// A text that tells fields apart by what they render, however their files are called.
    #[must_use]
    pub fn identity(&self) -> String {
        let Checkpoint { metadata: Metadata { config, bounds, features, .. }, state } =
            &self.opened.checkpoint;
        let settings = format!("{config:?} {bounds:?} {features:?}");
        let arrays = state.arrays.iter().flat_map(|(name, numbers)| {
            let bytes = match numbers {
                Numbers::Floats(numbers) => bytemuck::cast_slice(numbers),
                Numbers::Words(numbers) => bytemuck::cast_slice(numbers),
            };
            [name.as_bytes(), bytes]
        });
        checksum([settings.as_bytes()].into_iter().chain(arrays))
    }

    /// The colour space of what it renders.
    #[must_use]
    pub fn color_space(&self) -> ColorSpace {
        ColorSpace::of(self.metadata().features.hdr)
    }

    /// A renderer of the field for cameras with `lenses`.
    ///
    /// # Errors
    /// When the adapter cannot hold the field, or refuses a kernel.
    pub fn renderer(&self, gpu: &Arc<Gpu>, lenses: &BTreeSet<LensKind>) -> Result<Renderer> {
        Renderer::new(&Field::of(gpu, &self.opened.checkpoint)?, lenses)
    }
}
