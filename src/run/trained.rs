//! A trained field, from its checkpoint onto a device.

use crate::camera::LensKind;
use crate::field::checkpoint::{self, About, Checkpoint};
use crate::field::render::{PARAMETERS, Renderer};
use crate::field::{Plan, Workspace, density, training};
use crate::gpu::Gpu;
use crate::photo::color::ColorSpace;
use anyhow::Result;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A checkpoint that was read; of its state, what rendering needs is kept.
#[derive(Debug)]
pub struct TrainedField {
    /// The file.
    pub path: PathBuf,
    /// What it is.
    pub about: About,
    parameters: Vec<(&'static str, Vec<f32>)>,
    occupancy_bits: Vec<u32>,
}

impl TrainedField {
    /// Reads the checkpoint that `run`, a folder or the file itself, stands for.
    ///
    /// # Errors
    /// When there is none, or it cannot be used.
    pub fn load(run: &Path) -> Result<Self> {
        let path = checkpoint::locate(run)?;
        let Checkpoint { about, state } = Checkpoint::load(&path)?;
        let named = training::STATE.into_iter().zip(state.buffers);
        let parameters = named.filter(|(name, _)| PARAMETERS.contains(name)).collect();
        Ok(Self { path, about, parameters, occupancy_bits: state.occupancy_bits })
    }

    /// The colour space of what it renders.
    #[must_use]
    pub fn color_space(&self) -> ColorSpace {
        ColorSpace::of(self.about.needs.hdr)
    }

    /// A renderer of the field for cameras with `lenses`.
    ///
    /// # Errors
    /// When the adapter cannot hold the field, or refuses a kernel.
    pub fn renderer(&self, gpu: &Arc<Gpu>, lenses: &BTreeSet<LensKind>) -> Result<Renderer> {
        let About { config, needs, bounds, .. } = &self.about;
        let plan = Plan::new(gpu, config.clone(), self.about.layout(), needs.clone());
        let mut workspace = Workspace::default();
        density::allocate_parameters(gpu, &plan, &mut workspace)?;
        for (name, values) in &self.parameters {
            workspace.write(gpu, name, values);
        }
        workspace.write(gpu, "occupancy_bits", &self.occupancy_bits);
        let mut renderer = Renderer::new(gpu, &plan, &workspace, bounds, lenses)?;
        renderer.step_excess = self.about.step_excess;
        Ok(renderer)
    }
}
