//! The trainer: owns the field's parameters on the device and takes steps.
//!
//! It knows neither files nor progress bars: a step is a list of dispatches, and [`Trainer::report`] says
//! what happened since the last report.

use crate::camera::LensKind;
use crate::field::checkpoint::Metadata;
use crate::field::layout::pcg;
use crate::field::renderer::Renderer;
use crate::field::state::State;
use crate::field::training_views::TrainingViews;
use crate::field::visibility::hidden_cells;
use crate::field::{
    Counters, Field, Plan, Step, StepExcess, Workspace, backward, color, composite, density, dispatch, march,
    occupancy, optimize, rays,
};
use crate::gpu::Gpu;
use crate::gpu::pass::Stage;
use crate::gpu::timer::Timer;
use anyhow::Result;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

/// The name under which a timer finds the updates of the occupancy grid.
const OCCUPANCY: &str = "occupancy grid";

/// Trains one field on one device.
#[derive(Debug)]
pub struct Trainer {
    field: Field,
    workspace: Workspace,
    stages: Vec<Stage>,
    occupancy: occupancy::Update,
    step: u32,
    visible_cells: u32,
    /// Cells of the occupancy grid that nothing can be in.
    hidden: Vec<bool>,
}

/// What happened in the steps since the last report, per step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepStats {
    /// Steps reported.
    pub steps: u32,
    /// Rays of all of them.
    pub rays: u64,
    /// Marched samples of all of them.
    pub marched: u64,
    /// Samples with colour and gradients of all of them.
    pub samples: u64,
    /// Steps whose gradients were not finite, or so large that their squares would not be: they changed nothing.
    pub skipped: u32,
    /// Mean loss of the other steps.
    pub loss: f64,
    /// Mean squared error of the colour, relative to the colour where the loss is.
    pub color_error: f64,
}

impl Trainer {
    /// Allocates, uploads and begins to compile every kernel; parameters start from the configuration's seed.
    ///
    /// # Errors
    /// When a photo is missing, or the adapter cannot hold the table or the batch, or binds less than a kernel needs.
    pub fn new(mut field: Field, views: TrainingViews) -> Result<Self> {
        field.check_whole()?;
        views.check_for(&field.plan)?;
        let (gpu, plan) = (Arc::clone(&field.gpu), field.plan.clone());
        plan.check(&gpu)?;
        let mut workspace = Workspace::for_training(&field)?;
        workspace.add(gpu.storage_with("cameras", &views.on_device)?);
        workspace.add_pages(views.pages);
        let stages = step_stages(&gpu, &plan, &workspace, views.on_device.len())?;
        let occupancy = occupancy::Update::new(&gpu, &plan, &workspace)?;
        // While the kernels are compiled.
        let hidden =
            hidden_cells(&views.cameras, &views.silhouettes, &views.space, plan.config.occupancy.cells);
        let visible: Vec<u32> =
            (0..).zip(&hidden).filter(|(_, hidden)| !**hidden).map(|(cell, _)| cell).collect();
        workspace.write(&gpu, "visible_cells", &visible);
        let visible_cells = visible.len() as u32;
        field.step_excess = StepExcess::Counted(workspace.get("counters").clone());
        let mut trainer = Self { field, workspace, stages, occupancy, step: 0, hidden, visible_cells };
        trainer.reset()?;
        Ok(trainer)
    }

    /// Runs every kernel once, so that drivers that compile at the first dispatch have done so, and starts over.
    ///
    /// # Errors
    /// When the driver refuses a kernel, the device was lost or a kernel failed.
    pub fn warm_up(&mut self) -> Result<()> {
        self.step(0.0, None)?;
        self.refresh_occupancy(None)?;
        self.field.gpu.wait()?;
        self.reset()
    }

    /// Back to the initial parameters and step 0.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn reset(&mut self) -> Result<()> {
        let plan = &self.field.plan;
        let arrays = plan.arrays().map(|array| (array.name, array.start(plan, &self.hidden))).collect();
        let rays = plan.config.batch.first_rays;
        let step_excess = (plan.config.march.longest_step - 1.0) as f32;
        self.restore(&State { step: 0, rays, step_excess, arrays })
    }

    /// Goes on from `state`.
    ///
    /// # Errors
    /// When the state is of another layout, or the device was lost.
    pub fn restore(&mut self, state: &State) -> Result<()> {
        self.field.set_arrays(&state.arrays)?;
        let State { step_excess, .. } = *state;
        // The configuration may have less room for them than it had.
        let rays = state.rays.min(self.field.plan.config.batch.rays as u32);
        let counters = Counters { rays, rays_used: 1, step_excess, ..Counters::default() };
        self.field.gpu.write(self.workspace.get("counters"), 0, &[counters]);
        self.workspace.set_dispatch(&self.field.gpu, dispatch::RAYS, rays as usize);
        let mut encoder = self.field.gpu.encoder("restore");
        self.workspace.tensor("d_table").clear(&mut encoder);
        encoder.clear_buffer(&self.workspace.get("gradient_range").raw, 0, None);
        self.field.gpu.submit(encoder);
        self.step = state.step;
        self.field.gpu.wait()
    }

    /// Everything a later [`Trainer::restore`] needs.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn state(&self) -> Result<State> {
        let (rays, step_excess) = self.sampling()?;
        Ok(State { step: self.step, rays, step_excess, arrays: self.field.arrays()? })
    }

    /// Rays of the next step, and by how much its steps along them are longer than the configuration's, as a share of them.
    fn sampling(&self) -> Result<(u32, f32)> {
        let counters = self.field.gpu.read::<Counters>(self.workspace.get("counters"), 0, 1)?[0];
        Ok((counters.rays, counters.step_excess))
    }

    /// Writes the field and where its training stands to `path`, with what `metadata` says of it otherwise.
    ///
    /// # Errors
    /// When a number is not finite, the file cannot be written, or the device was lost.
    pub fn save(&self, path: &Path, metadata: Metadata) -> Result<()> {
        let (rays, step_excess) = self.sampling()?;
        self.field.save(path, Metadata { step: self.step, rays, step_excess, ..metadata })
    }

    /// One step: refresh the occupancy grid when it is due, then rays → march → density → select → colour →
    /// render·loss·gradient → backward → Adam. Submits and returns; [`Trainer::report`] waits.
    ///
    /// # Errors
    /// When the driver refuses a kernel, or the device reported an error.
    pub fn step(&mut self, learning_rate: f64, mut timer: Option<&mut Timer>) -> Result<()> {
        let grid = &self.field.plan.config.occupancy;
        if self.step > 0 && self.step.is_multiple_of(grid.interval) {
            self.refresh_occupancy(timer.as_deref_mut())?;
        }
        self.step += 1;
        let optimizer = &self.field.plan.config.optimizer;
        let step = Step { stream: self.stream(), ..Step::learning(optimizer, self.step, learning_rate) };
        self.field.gpu.write(self.workspace.get("step"), 0, &[step]);
        self.field.gpu.run("step", &self.stages, timer.as_deref_mut())?;
        if let Some(timer) = timer {
            timer.collect(&self.field.gpu, None)?;
        }
        self.field.gpu.check()
    }

    /// Steps taken.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.step
    }

    /// The device it trains on.
    #[must_use]
    pub fn gpu(&self) -> &Gpu {
        &self.field.gpu
    }

    /// The plan it was built from.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.field.plan
    }

    /// The field in training: a renderer of it shows it as it is then.
    #[must_use]
    pub fn field(&self) -> &Field {
        &self.field
    }

    /// A renderer of the field as it is whenever a view is rendered, for cameras with `lenses`. It works in the memory of the
    /// steps, between them.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn renderer(&self, lenses: &BTreeSet<LensKind>) -> Result<Renderer> {
        Renderer::within(&self.workspace, &self.field, lenses)
    }

    /// The buffers, for checks.
    #[must_use]
    pub fn workspace(&self) -> &Workspace {
        &self.workspace
    }

    /// Waits for the device and sums up the steps since the last report.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn report(&mut self) -> Result<StepStats> {
        let buffer = self.workspace.get("counters");
        let counters = self.field.gpu.read::<Counters>(buffer, 0, 1)?[0];
        let sums = std::mem::offset_of!(Counters, sum_steps) / size_of::<u32>();
        self.field.gpu.write(buffer, sums, &vec![0u32; size_of::<Counters>() / size_of::<u32>() - sums]);
        let used = f64::from(counters.sum_steps.saturating_sub(counters.sum_skipped).max(1));
        Ok(StepStats {
            steps: counters.sum_steps,
            rays: u64::from(counters.sum_rays),
            marched: u64::from(counters.sum_samples),
            samples: u64::from(counters.sum_kept),
            skipped: counters.sum_skipped,
            loss: f64::from(counters.sum_loss) / used,
            color_error: f64::from(counters.sum_color_error) / used,
        })
    }

    /// Start of this step's random numbers.
    fn stream(&self) -> u32 {
        pcg(self.step.wrapping_add(pcg(self.field.plan.config.seed)))
    }

    /// Visits every so many-th cell in turn.
    fn refresh_occupancy(&mut self, mut timer: Option<&mut Timer>) -> Result<()> {
        let grid = &self.field.plan.config.occupancy;
        let marched = self.field.plan.target_samples() as f64 * f64::from(grid.interval);
        let stride = (f64::from(self.visible_cells) / (grid.share * marched).max(1.0)).ceil().max(1.0) as u32;
        let first = (self.step / grid.interval) % stride;
        let cells = self.visible_cells.saturating_sub(first).div_ceil(stride);
        let most = self.field.plan.capacity.samples as u32;
        for begin in (0..cells).step_by(most as usize) {
            let count = most.min(cells - begin);
            let step = Step {
                stream: self.stream(),
                first_cell: first + begin * stride,
                cell_stride: stride,
                cell_count: count,
                ..Step::default()
            };
            self.field.gpu.write(self.workspace.get("step"), 0, &[step]);
            self.field.gpu.run(OCCUPANCY, self.occupancy.chunk(count as usize), timer.as_deref_mut())?;
            if let Some(timer) = timer.as_deref_mut() {
                timer.collect(&self.field.gpu, Some(OCCUPANCY))?;
            }
        }
        self.field.gpu.run(OCCUPANCY, self.occupancy.bits(), timer.as_deref_mut())?;
        timer.map_or(Ok(()), |timer| timer.collect(&self.field.gpu, Some(OCCUPANCY)))
    }
}

/// The stages of a step that draws from `cameras` cameras.
fn step_stages(gpu: &Gpu, plan: &Plan, workspace: &Workspace, cameras: usize) -> Result<Vec<Stage>> {
    let mut stages = vec![rays::stage(gpu, plan, workspace, cameras)?];
    stages.extend(march::stages(gpu, plan, workspace, true)?);
    stages.extend(density::stages(gpu, plan, workspace)?);
    stages.extend(color::stages(gpu, plan, workspace, color::SelectionMode::Training)?);
    stages.push(composite::stage(gpu, plan, workspace, false)?);
    stages.extend(backward::stages(gpu, plan, workspace)?);
    stages.extend(backward::weights(gpu, plan, workspace)?);
    stages.extend(optimize::stages(gpu, plan, workspace)?);
    Ok(stages)
}
