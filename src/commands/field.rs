//! A trained field, from its checkpoint onto the device.

use super::Session;
use anyhow::Result;
use nerf::camera::LensKind;
use nerf::field::checkpoint::{self, About, Checkpoint};
use nerf::field::render::{PARAMETERS, Renderer};
use nerf::field::{Plan, Workspace, density, training};
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
    parameters: Vec<(&'static str, Vec<f32>)>,
    occupancy_bits: Vec<u32>,
}

impl Field {
    /// Reads the checkpoint that `run` stands for; of its state, what rendering needs is kept.
    pub(super) fn load(run: &Path, session: &Session<'_>) -> Result<Self> {
        let path = checkpoint::locate(run)?;
        let Checkpoint { about, state } = Checkpoint::load(&path)?;
        session.remarks.detail(&format!(
            "{}: {} steps in {:.1} s on {}, trained on {}",
            path.display(),
            about.step,
            about.seconds,
            about.adapter,
            about.dataset
        ));
        let named = training::STATE.into_iter().zip(state.buffers);
        let parameters = named.filter(|(name, _)| PARAMETERS.contains(name)).collect();
        Ok(Self { path, about, parameters, occupancy_bits: state.occupancy_bits })
    }

    /// The colour space of what it renders.
    pub(super) fn color_space(&self) -> ColorSpace {
        ColorSpace::of(self.about.needs.hdr)
    }

    /// A renderer of the field for cameras with `lenses`.
    pub(super) fn renderer(&self, gpu: &Arc<Gpu>, lenses: &BTreeSet<LensKind>) -> Result<Renderer> {
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
