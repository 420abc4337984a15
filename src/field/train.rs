//! The trainer: owns the field's parameters on the device and takes steps.
//!
//! It knows neither files nor progress bars: a step is a list of dispatches, and [`Trainer::report`] says
//! what happened since the last report.

use crate::field::parameters::{FEATURES, pcg};
use crate::field::views::Views;
use crate::field::visibility::hidden_cells;
use crate::field::{Counters, Plan, Step, Workspace, color, density, dispatch, march, occupancy, training};
use crate::gpu::Gpu;
use crate::gpu::pass::Stage;
use crate::gpu::timer::Timer;
use anyhow::{Result, bail};
use std::sync::Arc;

/// The name under which a timer finds the updates of the occupancy grid.
const OCCUPANCY: &str = "occupancy grid";

/// Trains one field on one device.
#[derive(Debug)]
pub struct Trainer {
    gpu: Arc<Gpu>,
    plan: Plan,
    workspace: Workspace,
    stages: Vec<Stage>,
    occupancy: occupancy::Update,
    step: u32,
    visible_cells: u32,
    /// What every cell of the occupancy grid starts from; -1 where nothing can be.
    first_occupancy: Vec<f32>,
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

/// Everything that a training needs to go on as if it had never stopped.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Steps taken.
    pub step: u32,
    /// Rays of the next step.
    pub rays: u32,
    /// By how much its steps along the rays are longer than the configuration's, as a share of them.
    pub step_excess: f32,
    /// The buffers of [`training::STATE`], in that order.
    pub buffers: Vec<Vec<f32>>,
    /// One bit per occupied cell.
    pub occupancy_bits: Vec<u32>,
}

impl Trainer {
    /// Allocates, uploads and builds every kernel; parameters start from the configuration's seed.
    ///
    /// # Errors
    /// When a photo is missing, or the adapter cannot hold the table or the batch or refuses a kernel.
    pub fn new(gpu: &Arc<Gpu>, mut plan: Plan, views: Views) -> Result<Self> {
        views.check()?;
        plan.check(gpu)?;
        // Photos of which nothing can be drawn are never chosen.
        plan.needs.cameras = views.on_device.len();
        let hidden =
            hidden_cells(&views.cameras, &views.silhouettes, &views.bounds, plan.config.occupancy.cells);
        let visible: Vec<u32> =
            (0..).zip(&hidden).filter(|(_, hidden)| !**hidden).map(|(cell, _)| cell).collect();
        let mut workspace = Workspace::for_training(gpu, &plan, &visible)?;
        workspace.add(gpu.storage_with("cameras", &views.on_device)?);
        workspace.add_banks(views.banks);
        let stages = step_stages(gpu, &plan, &workspace)?;
        let occupancy = occupancy::Update::new(gpu, &plan, &workspace)?;
        // The networks begin with a log-density of about 0.
        let initial = (plan.step_min() * plan.density_scale()) as f32;
        let first_occupancy = hidden.iter().map(|&hidden| if hidden { -1.0 } else { initial }).collect();
        let visible_cells = visible.len() as u32;
        let mut trainer = Self {
            gpu: Arc::clone(gpu),
            plan,
            workspace,
            stages,
            occupancy,
            step: 0,
            first_occupancy,
            visible_cells,
        };
        trainer.reset()?;
        Ok(trainer)
    }

    /// Runs every kernel once, so that drivers that compile at the first dispatch have done so, and starts over.
    ///
    /// # Errors
    /// When the device was lost or a kernel failed.
    pub fn warm_up(&mut self) -> Result<()> {
        self.step(0.0, None)?;
        self.refresh_occupancy(None)?;
        self.gpu.wait()?;
        self.reset()
    }

    /// Back to the initial parameters and step 0.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn reset(&mut self) -> Result<()> {
        let seed = self.plan.config.seed;
        let layout = &self.plan.layout;
        let buffers = training::STATE
            .iter()
            .map(|&name| match name {
                "table" => layout.initial_table(seed),
                "mlp" => layout.initial_weights(seed),
                "occupancy" => self.first_occupancy.clone(),
                moments => vec![0.0; self.state_length(moments)],
            })
            .collect();
        let rays = self.plan.config.batch.first_rays;
        let bits = |cells: &[f32]| (0..32).fold(0, |word, bit| word | (u32::from(cells[bit] >= 0.0) << bit));
        let occupancy_bits = self.first_occupancy.chunks_exact(32).map(bits).collect();
        let step_excess = (self.plan.config.march.longest_step - 1.0) as f32;
        self.restore(&State { step: 0, rays, step_excess, buffers, occupancy_bits })
    }

    /// Goes on from `state`.
    ///
    /// # Errors
    /// When the state is of another layout, or the device was lost.
    pub fn restore(&mut self, state: &State) -> Result<()> {
        for (&name, data) in training::STATE.iter().zip(&state.buffers) {
            let expected = self.state_length(name);
            if data.len() != expected {
                bail!(
                    "the state's '{name}' has {} numbers, and this configuration needs {expected}",
                    data.len()
                );
            }
            self.workspace.write(&self.gpu, name, data);
        }
        self.workspace.write(&self.gpu, "occupancy_bits", &state.occupancy_bits);
        let State { rays, step_excess, .. } = *state;
        let counters = Counters { rays, rays_used: 1, step_excess, ..Counters::default() };
        self.gpu.write(self.workspace.get("counters"), 0, &[counters]);
        self.workspace.set_dispatch(&self.gpu, dispatch::RAYS, state.rays as usize);
        let mut encoder = self.gpu.encoder("restore");
        self.workspace.tensor("d_table").clear(&mut encoder);
        encoder.clear_buffer(&self.workspace.get("gradient_range").raw, 0, None);
        self.gpu.submit(encoder);
        self.step = state.step;
        self.gpu.wait()
    }

    /// Everything a later [`Trainer::restore`] needs.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn state(&self) -> Result<State> {
        let read = |name: &&str| self.workspace.read::<f32>(&self.gpu, name, self.state_length(name));
        let buffers = training::STATE.iter().map(read).collect::<Result<_>>()?;
        let counters = self.gpu.read::<Counters>(self.workspace.get("counters"), 0, 1)?[0];
        Ok(State {
            step: self.step,
            rays: counters.rays,
            step_excess: counters.step_excess,
            buffers,
            occupancy_bits: self.workspace.read(&self.gpu, "occupancy_bits", self.plan.cell_count() / 32)?,
        })
    }

    /// Number of floats of a part of the state.
    fn state_length(&self, name: &str) -> usize {
        let layout = &self.plan.layout;
        match name {
            "table" => layout.entries * FEATURES,
            "table_moments" => layout.entries * FEATURES * 2,
            "occupancy" => self.plan.cell_count(),
            _ => layout.quads * 4,
        }
    }

    /// One step: refresh the occupancy grid when it is due, then rays → march → density → select → colour →
    /// render·loss·gradient → backward → Adam. Submits and returns; [`Trainer::report`] waits.
    ///
    /// # Errors
    /// When the device reported an error.
    pub fn step(&mut self, learning_rate: f64, mut timer: Option<&mut Timer>) -> Result<()> {
        let grid = &self.plan.config.occupancy;
        if self.step > 0 && self.step.is_multiple_of(grid.interval) {
            self.refresh_occupancy(timer.as_deref_mut())?;
        }
        self.step += 1;
        let optimizer = &self.plan.config.optimizer;
        let step = Step { stream: self.stream(), ..Step::learning(optimizer, self.step, learning_rate) };
        self.gpu.write(self.workspace.get("step"), 0, &[step]);
        self.gpu.run("step", &self.stages, timer.as_deref_mut());
        if let Some(timer) = timer {
            timer.collect(&self.gpu, None)?;
        }
        self.gpu.check()
    }

    /// Steps taken.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.step
    }

    /// The device it trains on.
    #[must_use]
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// The plan it was built from.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The buffers, for rendering and for checks.
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
        let counters = self.gpu.read::<Counters>(buffer, 0, 1)?[0];
        let sums = std::mem::offset_of!(Counters, sum_steps) / size_of::<u32>();
        self.gpu.write(buffer, sums, &vec![0u32; size_of::<Counters>() / size_of::<u32>() - sums]);
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
        pcg(self.step.wrapping_add(pcg(self.plan.config.seed)))
    }

    /// Visits every so many-th cell in turn.
    fn refresh_occupancy(&mut self, mut timer: Option<&mut Timer>) -> Result<()> {
        let grid = &self.plan.config.occupancy;
        let marched = self.plan.target_samples() as f64 * f64::from(grid.interval);
        let stride = (f64::from(self.visible_cells) / (grid.share * marched).max(1.0)).ceil().max(1.0) as u32;
        let first = (self.step / grid.interval) % stride;
        let cells = self.visible_cells.saturating_sub(first).div_ceil(stride);
        let most = self.plan.config.batch.samples as u32;
        for begin in (0..cells).step_by(most as usize) {
            let count = most.min(cells - begin);
            let step = Step {
                stream: self.stream(),
                first_cell: first + begin * stride,
                cell_stride: stride,
                cell_count: count,
                ..Step::default()
            };
            self.gpu.write(self.workspace.get("step"), 0, &[step]);
            self.gpu.run(OCCUPANCY, self.occupancy.chunk(count as usize), timer.as_deref_mut());
            if let Some(timer) = timer.as_deref_mut() {
                timer.collect(&self.gpu, Some(OCCUPANCY))?;
            }
        }
        self.gpu.run(OCCUPANCY, self.occupancy.bits(), timer.as_deref_mut());
        timer.map_or(Ok(()), |timer| timer.collect(&self.gpu, Some(OCCUPANCY)))
    }
}

fn step_stages(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Vec<Stage>> {
    let mut stages = vec![training::rays(gpu, plan, workspace)?];
    stages.extend(march::stages(gpu, plan, workspace, true)?);
    stages.extend(density::stages(gpu, plan, workspace)?);
    stages.extend(color::stages(gpu, plan, workspace, color::Selection::Training)?);
    stages.push(training::composite(gpu, plan, workspace, false)?);
    stages.extend(training::backward(gpu, plan, workspace)?);
    stages.extend(training::weight_gradients(gpu, plan, workspace)?);
    stages.extend(training::update(gpu, plan, workspace)?);
    Ok(stages)
}
