//! A device with a plan and all its buffers, on which kernels can be run one by one.

use super::Setup;
use super::inputs::quiet_step;
use crate::field::layout::DENSITY_OUTPUTS;
use crate::field::{
    Counters, Field, Plan, RayResult, RayTarget, Step, Workspace, backward, color, composite, density,
    dispatch, march, optimize, records,
};
use crate::gpu::Gpu;
use crate::gpu::paged_array::{PageCapacity, PagedArray, rows_of};
use crate::gpu::pass::Stage;
use crate::verify::reference::model::TrainingRay;
use anyhow::{Context, Result, ensure};
use bytemuck::Pod;
use std::sync::Arc;

/// A device with a plan and all its buffers. Whole stages run on it, and gradients are read from Adam's first
/// moments where [`Setup::tiny`] left β₁ at 0.
#[derive(Clone, Debug)]
pub struct Workbench {
    /// The device.
    pub gpu: Arc<Gpu>,
    /// How kernels are linked.
    pub plan: Plan,
    /// The field.
    pub field: Field,
    /// The buffers.
    pub workspace: Workspace,
    /// The scan over marched samples.
    scan: Arc<Stage>,
}

/// Rows of a page of photos: so few that some photos lie in two pages.
const PAGE_ROWS: usize = 3;

/// A kept sample as `shaders/common/kept_load.wgsl` reads it.
pub(super) type KeptStep = [[f32; 4]; 2];

/// A kept sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeptSample {
    /// Which of the marched samples.
    pub sample: u32,
    /// Its ray.
    pub ray: u32,
    /// Log-density.
    pub s: f32,
    /// Step.
    pub delta: f32,
    /// Optical depth of what was left out in front of it.
    pub gap: f32,
    /// How many times its own weight its colour has in both estimates.
    pub gains: [f32; 2],
}

/// What one pass over a batch left on the device.
#[derive(Clone, Debug)]
pub struct PassOutput {
    /// Raw outputs of the density network, `[samples, 16]`.
    pub density: Vec<f32>,
    /// Activated colours, `[kept, 3]`.
    pub color: Vec<f32>,
    /// Colour and opacity of the rays.
    pub rendered: Vec<[f32; 4]>,
    /// Loss of the batch.
    pub loss: f64,
    /// By the table, `[entries, 2]`.
    pub d_table: Vec<f32>,
    /// By each layer's weights, `[outputs, inputs]`, first the density network's layers.
    pub d_weights: Vec<Vec<f32>>,
}

impl Workbench {
    /// Allocates what `setup` asks for, with room for the weights of every marched sample.
    ///
    /// # Errors
    /// When the configuration is out of range, or the adapter cannot hold it.
    pub fn new(gpu: &Arc<Gpu>, setup: &Setup) -> Result<Self> {
        let plan = setup.plan(gpu)?;
        let field = Field::new(gpu, plan)?;
        let mut workspace = Workspace::for_training(&field)?;
        workspace.write(gpu, "visible_cells", &visible_cells(field.plan()));
        workspace.add(gpu.storage::<f32>("weights", field.plan().capacity.samples)?);
        let bench = Self::of(field, workspace)?;
        bench.set_step(quiet_step());
        Ok(bench)
    }

    /// The buffers of something else, for example of a trainer.
    ///
    /// # Errors
    /// When the adapter refuses a kernel.
    pub fn of(field: Field, workspace: Workspace) -> Result<Self> {
        let (gpu, plan) = (Arc::clone(field.gpu()), field.plan().clone());
        let scan = Arc::new(march::scan(&gpu, &plan, &workspace, march::Scanned::Samples)?);
        Ok(Self { gpu, plan, field, workspace, scan })
    }

    /// Writes `data` at the start of a buffer or tensor, before the next submission.
    pub fn write<T: Pod>(&self, name: &str, data: &[T]) {
        self.workspace.write(&self.gpu, name, data);
    }

    /// Reads the first `count` values of a buffer or tensor.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn read<T: Pod>(&self, name: &str, count: usize) -> Result<Vec<T>> {
        self.workspace.read(&self.gpu, name, count)
    }

    /// Sets the numbers that change from step to step.
    pub fn set_step(&self, step: Step) {
        self.write("step", &[step]);
    }

    /// What was counted on the device.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn counters(&self) -> Result<Counters> {
        self.read("counters", 1)?.pop().context("the device returned no counters")
    }

    /// Sets what is counted on the device, and the size of the dispatches over rays.
    pub fn set_counters(&self, counters: Counters) {
        self.write("counters", &[counters]);
        self.workspace.set_dispatch(&self.gpu, dispatch::RAYS, counters.rays as usize);
    }

    /// Sets the number of rays to draw or march; nothing else is counted.
    pub fn set_rays(&self, rays: usize) {
        self.set_counters(Counters { rays: rays as u32, ..Counters::default() });
    }

    /// Runs `stages` in order and waits for them.
    ///
    /// # Errors
    /// When the device was lost or refused a command.
    pub fn run<'a>(&self, stages: impl IntoIterator<Item = &'a Stage>) -> Result<()> {
        self.gpu.run("check", stages, None)?;
        self.gpu.wait()
    }

    /// Runs the one stage of `stages` that is called `label`.
    ///
    /// # Errors
    /// When there is none, or as [`Workbench::run`].
    pub fn run_only(&self, stages: &[Stage], label: &str) -> Result<()> {
        let stage = stages.iter().find(|stage| stage.bound.label == label);
        self.run(Some(stage.with_context(|| format!("there is no stage called '{label}'"))?))
    }

    /// Origin and `t_near`, direction and `t_far` of the rays.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn rays(&self, count: usize) -> Result<Vec<[[f32; 4]; 2]>> {
        self.read("ray_lines", count)
    }

    /// Writes origin and `t_near`, direction and `t_far` of rays.
    pub fn set_rays_along(&self, lines: &[[[f32; 4]; 2]]) {
        self.write("ray_lines", lines);
    }

    /// The kept samples.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn kept(&self, count: usize) -> Result<Vec<KeptSample>> {
        let rows: Vec<[u32; 2]> = self.read("kept_rows", count)?;
        let steps: Vec<KeptStep> = self.read("kept_steps", count)?;
        Ok((rows.into_iter().zip(steps))
            .map(|([sample, ray], [[s, delta, gap, _], [first, second, ..]])| KeptSample {
                sample,
                ray,
                s,
                delta,
                gap,
                gains: [first, second],
            })
            .collect())
    }

    /// Log-densities and steps of the kept samples, as if all had been chosen.
    pub fn set_kept_steps(&self, steps: &[[f32; 2]]) {
        let all = steps.iter().map(|&[s, delta]| [[s, delta, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0]]);
        self.write::<KeptStep>("kept_steps", &all.collect::<Vec<_>>());
    }

    /// Puts a batch on the device as if it had been drawn and marched.
    ///
    /// # Errors
    /// When it has more samples than there is room for, or the device was lost.
    pub fn upload(&self, rays: &[TrainingRay]) -> Result<()> {
        let (mut spans, mut samples) = (Vec::new(), Vec::new());
        for ray in rays {
            spans.push([0, ray.samples.len() as u32]);
            samples.extend(ray.samples.iter().map(|sample| {
                let [x, y, z] = sample.position.as_vec3().to_array();
                [x, y, z, sample.delta as f32]
            }));
        }
        let room = &self.plan.config.batch;
        ensure!(
            rays.len() <= room.rays && samples.len() <= room.samples,
            "{} rays with {} samples do not fit the workbench, which has room for {} with {}",
            rays.len(),
            samples.len(),
            room.rays,
            room.samples
        );
        let line = |ray: &TrainingRay| [[0.0; 4], ray.direction.as_vec3().extend(1.0).to_array()];
        self.set_rays_along(&rays.iter().map(line).collect::<Vec<_>>());
        self.write("ray_spans", &spans);
        self.write("samples", &samples);
        self.set_targets(rays.iter().map(|ray| (ray.target, ray.background, ray.depth)));
        // The scan turns counts into spans and sets all dispatch sizes.
        self.set_rays(rays.len());
        self.run([&*self.scan])
    }

    /// What rays should show: colour and opacity, background, and distance.
    pub fn set_targets(&self, targets: impl Iterator<Item = ([f64; 4], [f64; 3], f64)>) {
        let targets: Vec<_> = targets
            .map(|(color, background, depth)| RayTarget {
                color: color.map(|x| x as f32),
                background: background.map(|x| x as f32),
                depth: depth as f32,
            })
            .collect();
        self.write("ray_targets", &targets);
    }

    /// What rays showed.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn results(&self, rays: usize) -> Result<Vec<RayResult>> {
        self.read("ray_results", rays)
    }

    /// Puts these words of photos on the device, in pages of a few rows.
    ///
    /// # Errors
    /// When the adapter cannot hold them.
    pub fn add_photos(&mut self, words: &[u32]) -> Result<()> {
        let (capacity, rows) =
            (PageCapacity::of(&self.gpu.device.limits(), self.plan.memory), rows_of(words.len()));
        // More where the adapter binds few of them.
        let capacity = capacity.with_page_rows(PAGE_ROWS.max(rows.div_ceil(capacity.pages())));
        let mut pages = PagedArray::new(&self.gpu, records::NAME, rows, capacity)?;
        pages.write(&self.gpu, 0, words)?;
        self.workspace.add_pages(pages);
        Ok(())
    }

    /// Raw log-densities of the samples, as if the network had run.
    pub fn set_raw_density(&self, raw: &[f32]) {
        let mut outputs = vec![0.0; raw.len() * DENSITY_OUTPUTS];
        outputs.iter_mut().step_by(DENSITY_OUTPUTS).zip(raw).for_each(|(output, &raw)| *output = raw);
        self.write("density_out", &outputs);
    }

    /// Raw outputs of the density network, `[samples, 16]`.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn density(&self, samples: usize) -> Result<Vec<f32>> {
        self.read("density_out", samples * DENSITY_OUTPUTS)
    }

    /// Activated colours, `[kept, 3]`.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn color(&self, kept: usize) -> Result<Vec<f32>> {
        let color: Vec<[f32; 4]> = self.read("color", kept)?;
        Ok(color.iter().flat_map(|color| [color[0], color[1], color[2]]).collect())
    }

    /// Everything behind marching, from encoding to Adam.
    ///
    /// # Errors
    /// When a kernel cannot be built.
    pub fn stages(&self) -> Result<Vec<Stage>> {
        let (gpu, plan, workspace) = (&self.gpu, &self.plan, &self.workspace);
        let mut stages = density::stages(gpu, plan, workspace)?;
        stages.extend(color::stages(gpu, plan, workspace, color::SelectionMode::Training)?);
        stages.push(composite::stage(gpu, plan, workspace, true)?);
        stages.extend(backward::stages(gpu, plan, workspace)?);
        stages.extend(backward::weights(gpu, plan, workspace)?);
        stages.extend(optimize::stages(gpu, plan, workspace)?);
        Ok(stages)
    }

    /// Runs a batch from samples to gradients; `stages` are those of [`Workbench::stages`].
    ///
    /// # Errors
    /// As [`Workbench::upload`] and [`Workbench::run`].
    pub fn train(&self, stages: &[Stage], rays: &[TrainingRay]) -> Result<PassOutput> {
        self.clear_table_moments();
        self.upload(rays)?;
        self.run(stages)?;
        let counters = self.counters()?;
        let [d_table, _] = self.table_moments()?;
        Ok(PassOutput {
            density: self.density(counters.samples as usize)?,
            color: self.color(counters.kept as usize)?,
            rendered: self.results(counters.rays_used as usize)?.iter().map(|ray| ray.rendered).collect(),
            loss: f64::from(counters.sum_loss),
            d_table,
            d_weights: self.weights("mlp_first")?,
        })
    }
}

/// The cells that can hold something on every workbench: all but every fifth.
#[must_use]
pub fn visible_cells(plan: &Plan) -> Vec<u32> {
    (0..plan.cell_count() as u32).filter(|cell| cell % 5 != 0).collect()
}
