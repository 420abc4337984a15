//! The renderer: a trained field seen by any camera, in chunks of pixels.

use crate::camera::{Camera, LensKind};
use crate::dataset::Bounds;
use crate::gpu::Gpu;
use crate::gpu::demand::Demand;
use crate::gpu::pass::Stage;
use crate::kernels::{self, Counters, Plan, Step, Workspace, color, density, marching, viewing};
use anyhow::{Result, bail};
use std::collections::BTreeSet;
use std::sync::Arc;

/// Names of the buffers that a renderer shares with a trainer, or fills from a checkpoint.
pub const PARAMETERS: [&str; 5] = ["levels", "table", "mlp", "occupancy", "occupancy_bits"];

/// Marched samples of one chunk; independent of the training's batch.
const SAMPLES: usize = 1 << 16;
/// Most pixels of one chunk.
const RAYS: usize = 1 << 14;

/// A rendered view.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Premultiplied colour in the field's colour space (sRGB or linear), without background, and opacity.
    pub color: Vec<[f32; 4]>,
    /// Mean depth in world units, as [`LensKind::depth_is_distance`] defines it; 0 where the opacity is below 1e-3.
    pub depth: Vec<f32>,
}

/// Renders a field.
#[derive(Debug)]
pub struct Renderer {
    gpu: Arc<Gpu>,
    workspace: Workspace,
    stages: Vec<Stage>,
    bounds: Bounds,
    /// Scene-linear brightness of a field colour of 1.
    grey: f32,
    lenses: BTreeSet<LensKind>,
    rays: u32,
}

impl Renderer {
    /// A renderer of the field whose parameters `field` holds, for cameras with `lenses`.
    ///
    /// # Errors
    /// When the adapter cannot hold a chunk or refuses a kernel.
    pub fn new(
        gpu: &Arc<Gpu>,
        plan: &Plan,
        field: &Workspace,
        bounds: &Bounds,
        lenses: &BTreeSet<LensKind>,
    ) -> Result<Self> {
        let mut plan = chunk_plan(plan);
        plan.needs.lenses.clone_from(lenses);
        let mut workspace = Workspace::default();
        for name in PARAMETERS {
            workspace.share(field, name);
        }
        workspace.allocate(gpu, &plan.viewing_demands())?;
        let mut stages = vec![viewing::rays(gpu, &plan, &workspace)?];
        stages.extend(marching::stages(gpu, &plan, &workspace, false)?);
        stages.extend(density::stages(gpu, &plan, &workspace)?);
        stages.extend(color::stages(gpu, &plan, &workspace, color::Selection::All)?);
        stages.push(viewing::composite(gpu, &plan, &workspace)?);
        let (gpu, bounds, lenses) = (Arc::clone(gpu), bounds.clone(), lenses.clone());
        Ok(Self { gpu, workspace, stages, bounds, grey: plan.needs.grey, lenses, rays: 1024 })
    }

    /// Bytes on the device that a renderer of `plan` takes besides the parameters.
    #[must_use]
    pub fn bytes(plan: &Plan) -> u64 {
        chunk_plan(plan).viewing_demands().iter().map(Demand::bytes).sum()
    }

    /// Renders what `camera` sees.
    ///
    /// # Errors
    /// When the device was lost, or the camera has a lens that was not linked.
    pub fn render(&mut self, camera: &Camera) -> Result<View> {
        let kind = camera.lens.kind();
        if !self.lenses.contains(&kind) {
            let linked: Vec<_> = self.lenses.iter().map(|kind| kind.name()).collect();
            bail!(
                "this renderer was built for the lenses {}, and the camera's is {}; name all lenses when building it",
                linked.join(", "),
                kind.name()
            );
        }
        let pixels = camera.width as usize * camera.height as usize;
        let mut color = Vec::with_capacity(pixels);
        let mut depth = Vec::with_capacity(pixels);
        let camera_in_box = kernels::Camera::in_box(camera, &self.bounds);
        self.gpu.write(self.workspace.get("cameras"), 0, &[camera_in_box]);
        while color.len() < pixels {
            let asked = (self.rays as usize).min(pixels - color.len());
            let used = self.render_chunk(color.len(), asked)?;
            color.extend(self.gpu.read::<[f32; 4]>(self.workspace.get("view_color"), 0, used)?);
            depth.extend(self.gpu.read::<f32>(self.workspace.get("view_depth"), 0, used)?);
        }
        color.iter_mut().flat_map(|pixel| &mut pixel[..3]).for_each(|value| *value *= self.grey);
        let world_per_box = (self.bounds.outer_half() * 2.0) as f32;
        depth.iter_mut().for_each(|z| *z *= world_per_box);
        Ok(View { width: camera.width, height: camera.height, color, depth })
    }

    /// Renders up to `rays` pixels from `first` on; returns how many fitted, at least one.
    fn render_chunk(&mut self, first: usize, rays: usize) -> Result<usize> {
        let counters = Counters { rays: rays as u32, ..Counters::default() };
        self.gpu.write(self.workspace.get("counters"), 0, &[counters]);
        let groups = [[rays.div_ceil(64) as u32, 1, 1, 0]];
        self.gpu.write(self.workspace.get("dispatch"), kernels::dispatch::RAYS, &groups);
        let step = Step { first_pixel: first as u32, ..Step::default() };
        self.gpu.write(self.workspace.get("step"), 0, &[step]);
        self.gpu.run("view", &self.stages, None);
        let counters = self.gpu.read::<Counters>(self.workspace.get("counters"), 0, 1)?[0];
        let used = counters.rays_used as usize;
        if used == 0 {
            bail!(
                "the device rendered none of {rays} rays: its driver does not run the kernels as it should"
            );
        }
        let fit = SAMPLES as f64 * 0.8 / f64::from(counters.samples_wanted.max(1)) * rays as f64;
        self.rays = fit.clamp(64.0, RAYS as f64) as u32;
        Ok(used)
    }
}

/// The plan of a renderer: every sample of a chunk gets colour.
fn chunk_plan(plan: &Plan) -> Plan {
    let mut plan = plan.clone();
    plan.config.batch.samples = SAMPLES.max(plan.config.march.most_steps);
    plan.config.batch.kept = plan.config.batch.samples;
    plan.config.batch.rays = RAYS;
    plan
}
