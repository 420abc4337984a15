//! Refreshing the occupancy grid from the density network.

use super::density;
use crate::field::sizes::CELLS;
use crate::field::{Link, Plan, Workspace};
use crate::gpu::Gpu;
use crate::gpu::buffer_spec::BufferSpec;
use crate::gpu::pass::Stage;
use anyhow::Result;

/// The stages of an update.
#[derive(Debug)]
pub struct Update {
    /// Random positions in a chunk of cells.
    samples: Stage,
    /// The density there.
    density: Vec<Stage>,
    /// Raises the cells to it.
    raise: Stage,
    /// Values become bits, once all chunks are through.
    bits: [Stage; 2],
}

/// What only the update needs, for `visible` cells that can hold something.
pub(crate) fn buffers(visible: usize) -> Vec<BufferSpec> {
    vec![
        BufferSpec::storage::<f32>("occupancy_mean", 1),
        BufferSpec::storage::<u32>("visible_cells", visible.max(1)).sized_by(CELLS),
    ]
}

impl Update {
    /// Builds the stages.
    ///
    /// # Errors
    /// When a kernel cannot be built.
    pub fn new(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Self> {
        let bound = |link: &Link| workspace.bind(gpu, &plan.kernel(gpu, link)?, &[]);
        Ok(Self {
            samples: Stage::single(bound(&Link::of("occupancy samples").with("counted", "written"))?),
            density: density::stages(gpu, plan, workspace)?,
            raise: Stage::single(bound(&Link::of("occupancy update"))?),
            bits: [
                Stage::single(bound(&Link::of("occupancy mean"))?),
                Stage::wide(bound(&Link::of("occupancy bits"))?, plan.cell_count() / 32),
            ],
        })
    }

    /// The stages for a chunk of `cells` cells.
    pub fn chunk(&mut self, cells: usize) -> impl Iterator<Item = &Stage> {
        self.samples.resize(cells);
        self.raise.resize(cells);
        [&self.samples].into_iter().chain(&self.density).chain([&self.raise])
    }

    /// The stages that turn values into bits.
    #[must_use]
    pub fn bits(&self) -> &[Stage] {
        &self.bits
    }
}
