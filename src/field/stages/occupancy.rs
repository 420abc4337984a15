//! Refreshing the occupancy grid from the density network.

use crate::field::{Link, Plan, Workspace, density};
use crate::gpu::Gpu;
use crate::gpu::demand::Demand;
use crate::gpu::pass::{Size, Stage};
use anyhow::Result;

/// The stages of an update: `chunk` runs once per chunk of cells, `bits` once at the end.
#[derive(Debug)]
pub struct Update {
    chunk: Vec<Stage>,
    bits: Vec<Stage>,
    level_pairs: usize,
    rows_per_thread: usize,
}

// Positions in the list of stages of a chunk: samples, encode, two layers, update.
const ENCODE: usize = 1;
const ENCODE_END: usize = 2;
const LAYERS_END: usize = 4;

/// What only the update needs, for `visible` cells that can hold something.
pub(crate) fn demands(visible: usize) -> Vec<Demand> {
    vec![Demand::storage::<f32>("occupancy_mean", 1), Demand::storage::<u32>("visible_cells", visible.max(1))]
}

impl Update {
    /// Builds the stages.
    ///
    /// # Errors
    /// When a kernel cannot be built.
    pub fn new(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Self> {
        let samples = Link::of("occupancy samples").with("counted", "written");
        let samples = plan.kernel(gpu, &samples)?;
        let update = plan.kernel(gpu, &Link::of("occupancy update"))?;
        let mean = plan.kernel(gpu, &Link::of("occupancy mean"))?;
        let bits = plan.kernel(gpu, &Link::of("occupancy bits"))?;
        let mut chunk = vec![Stage::fixed(workspace.bind(gpu, &samples, &[])?, 1, 1)];
        chunk.extend(density::stages(gpu, plan, workspace)?);
        chunk.push(Stage::fixed(workspace.bind(gpu, &update, &[])?, 1, 1));
        let words = plan.cell_count() / 32;
        Ok(Self {
            chunk,
            bits: vec![
                Stage::fixed(workspace.bind(gpu, &mean, &[])?, 1, 1),
                Stage::wide(workspace.bind(gpu, &bits, &[])?, words.div_ceil(64)),
            ],
            level_pairs: plan.layout.levels.len() / 2,
            rows_per_thread: plan.product.rows,
        })
    }

    /// The stages for a chunk of `cells` cells.
    pub fn chunk(&mut self, cells: usize) -> &[Stage] {
        for (index, stage) in self.chunk.iter_mut().enumerate() {
            let (per_group, rows) = match index {
                ENCODE => (64, self.level_pairs),
                ENCODE_END..LAYERS_END => (64 * self.rows_per_thread, 1),
                _ => (64, 1),
            };
            stage.size = Size::Fixed(cells.div_ceil(per_group) as u32, rows as u32);
        }
        &self.chunk
    }

    /// The stages that turn values into bits.
    #[must_use]
    pub fn bits(&self) -> &[Stage] {
        &self.bits
    }
}
