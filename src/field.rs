//! The radiance field on a device: its parameters and kernels, training it and rendering it.

mod buffers;
mod capabilities;
pub mod capacity;
pub mod checkpoint;
mod constants;
pub mod dispatch;
mod features;
pub mod generated;
mod kernels;
pub mod layer;
pub mod layout;
pub mod lenses;
pub mod link;
pub mod parameters;
mod plan;
pub mod records;
pub mod renderer;
mod shared;
pub mod silhouette;
mod sizes;
mod space;
pub mod stages;
pub mod state;
mod supersampling;
mod tiled_layer;
pub mod trainer;
pub mod training_views;
pub mod variants;
pub mod visibility;
mod workspace;

pub use capabilities::Capabilities;
pub use capacity::{Capacity, Rounds};
pub use constants::{RELATIVE_FLOOR, STEP_GROWTH, STEP_SHRINKAGE, dimension};
pub use features::SceneFeatures;
pub use link::Link;
pub use plan::Plan;
pub use shared::{Counters, DeviceCamera, LAYOUTS, Progress, RayResult, RayTarget, Step, Tile};
pub use space::Space;
pub use stages::{backward, color, composite, density, march, occupancy, optimize, rays, viewing};
pub use workspace::Workspace;

use crate::gpu::Gpu;
use crate::gpu::buffer::Buffer;
use anyhow::{Result, ensure};
use checkpoint::{Checkpoint, Metadata};
use parameters::Numbers;
use state::State;
use std::path::Path;
use std::sync::Arc;

/// A radiance field on a device: how its kernels are linked, where it is, and the arrays that it consists of. A clone has
/// the same arrays.
#[derive(Clone, Debug)]
pub struct Field {
    gpu: Arc<Gpu>,
    plan: Plan,
    arrays: Workspace,
    /// Whether arrays that only training reads are there too.
    is_whole: bool,
    step_excess: StepExcess,
}

/// By how much the steps along rays that a field was trained with are longer than the configuration's, as a share of them.
#[derive(Clone, Debug)]
enum StepExcess {
    /// This.
    Known(f32),
    /// What the counters of a training run say.
    Counted(Buffer),
}

impl Field {
    /// Room for a field and for everything that training keeps of it, all zeros: a trainer sets it to where training
    /// begins.
    ///
    /// # Errors
    /// When the adapter cannot hold it.
    pub fn new(gpu: &Arc<Gpu>, plan: Plan) -> Result<Self> {
        Self::allocate(gpu, plan, true)
    }

    /// What rendering needs of a checkpoint.
    ///
    /// # Errors
    /// When the adapter cannot hold it.
    pub fn of(gpu: &Arc<Gpu>, checkpoint: &Checkpoint) -> Result<Self> {
        let mut field = Self::allocate(gpu, checkpoint.metadata.plan(Capabilities::of(gpu)), false)?;
        field.arrays.set_arrays(gpu, &field.plan, &checkpoint.state.arrays)?;
        field.step_excess = StepExcess::Known(checkpoint.state.step_excess);
        Ok(field)
    }

    /// What rendering needs of the checkpoint in a file or in the folder of a run, and what that says about itself.
    ///
    /// # Errors
    /// When there is none, it cannot be used, or the adapter cannot hold the field.
    pub fn load(gpu: &Arc<Gpu>, path: &Path) -> Result<(Self, Metadata)> {
        let checkpoint = Checkpoint::load(&checkpoint::locate(path)?)?;
        Ok((Self::of(gpu, &checkpoint)?, checkpoint.metadata))
    }

    /// Writes it as a checkpoint that says `metadata` of itself.
    ///
    /// # Errors
    /// When it has only what rendering reads, a number is not finite, or the file cannot be written.
    pub fn save(&self, path: &Path, metadata: Metadata) -> Result<()> {
        let Metadata { step, rays, step_excess, .. } = metadata;
        let state = State { step, rays, step_excess, arrays: self.arrays()? };
        Checkpoint { metadata, state }.save(path)
    }

    fn allocate(gpu: &Arc<Gpu>, plan: Plan, is_whole: bool) -> Result<Self> {
        let mut arrays = Workspace::default();
        arrays.allocate(gpu, &plan.field_buffers(is_whole))?;
        arrays.write(gpu, "levels", &plan.layout.levels);
        Ok(Self { gpu: Arc::clone(gpu), plan, arrays, is_whole, step_excess: StepExcess::Known(0.0) })
    }

    /// The same field, of whose views as much is in work at once as `rounds` say.
    #[must_use]
    pub fn with_rounds(&self, rounds: Rounds) -> Self {
        Self { plan: Plan { rounds, ..self.plan.clone() }, ..self.clone() }
    }

    /// How its kernels are linked.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Where it is.
    #[must_use]
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// The numbers of its arrays.
    ///
    /// # Errors
    /// When it has only those that rendering reads, or the device was lost.
    pub fn arrays(&self) -> Result<Vec<(&'static str, Numbers)>> {
        self.check_whole()?;
        self.arrays.arrays(&self.gpu, &self.plan)
    }

    /// Whether it has what only training reads.
    fn check_whole(&self) -> Result<()> {
        ensure!(
            self.is_whole,
            "this field was loaded to be rendered, without what training keeps of it; train a new one, and give its \
             Trainer::restore the checkpoint's state"
        );
        Ok(())
    }

    /// Sets the numbers of its arrays.
    ///
    /// # Errors
    /// When an array is missing or of another size.
    pub fn set_arrays(&self, arrays: &[(&'static str, Numbers)]) -> Result<()> {
        self.arrays.set_arrays(&self.gpu, &self.plan, arrays)
    }
}
