//! The renderer: a trained field seen by any camera, front to back in rounds of a few samples per ray.

use crate::camera::{Camera, LensKind};
use crate::field::{
    self, Counters, Field, Plan, Progress, StepExcess, Workspace, color, density, dispatch, march, viewing,
};
use crate::gpu::Gpu;
use crate::gpu::buffer_spec::BufferSpec;
use crate::gpu::pass::Stage;
use anyhow::{Result, bail, ensure};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::iter::repeat_n;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Most rounds of one submission: drivers give up on those that take seconds.
const MOST_ROUNDS: usize = 8;

/// Pixels that a thread of the host takes at once.
const PIXELS_AT_ONCE: usize = 1 << 14;

/// How much of what training steps are too long by is left in a view: rays that are not jittered need finer ones.
/// Without any a view takes twice as long for 0.2 dB more (can_270x480), with all of it it has 0.5 dB less.
const STEP_EXCESS: f32 = 0.5;

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

/// What views took since they were last asked about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ViewCost {
    /// Time in which the device was at work, or what it had done came to the host.
    pub device: Duration,
    /// Time in which the host made pixels of it.
    pub host: Duration,
    /// Rounds of samples.
    pub rounds: usize,
}

/// Renders a field.
#[derive(Debug)]
pub struct Renderer {
    gpu: Arc<Gpu>,
    plan: Plan,
    workspace: Workspace,
    /// Gives the free slots of rays to the next pixels; the last stage of a round, and what the first one begins with.
    refill: Stage,
    /// The others.
    round: Vec<Stage>,
    /// Rounds that the last band of pixels took.
    rounds: usize,
    step_excess: StepExcess,
    /// Where the host reads the pixels of a band; there is one once there was a band.
    staging: Option<wgpu::Buffer>,
    cost: ViewCost,
}

impl Renderer {
    /// A renderer of a field, for cameras with `lenses`.
    ///
    /// # Errors
    /// Without lenses, or when the adapter cannot hold a round, or binds less than a kernel needs.
    pub fn new(field: &Field, lenses: &BTreeSet<LensKind>) -> Result<Self> {
        Self::within(&Workspace::default(), field, lenses)
    }

    /// As [`Renderer::new`], where the steps of the field's training have their memory, as far as that goes.
    pub(super) fn within(steps: &Workspace, field: &Field, lenses: &BTreeSet<LensKind>) -> Result<Self> {
        ensure!(
            !lenses.is_empty(),
            "a renderer needs the lenses of the cameras that it will be given, found none"
        );
        let (gpu, plan) = (&field.gpu, field.plan.for_views(lenses));
        let mut workspace = Workspace::default();
        workspace.share(&field.arrays);
        let is_lent = |spec: &BufferSpec| steps.has(spec.name) && field.plan.lends(spec);
        let (lent, own): (Vec<_>, Vec<_>) = plan.viewing_buffers().into_iter().partition(is_lent);
        workspace.share_some(steps, &lent);
        workspace.allocate(gpu, &own)?;
        let refill = march::scan(gpu, &plan, &workspace, march::Scanned::Free)?;
        let mut round = vec![viewing::rays(gpu, &plan, &workspace)?];
        round.extend(march::stages_over(gpu, &plan, &workspace, false, march::MarchExtent::Round)?);
        round.extend(density::stages(gpu, &plan, &workspace)?);
        round.extend(color::stages(gpu, &plan, &workspace, color::SelectionMode::View)?);
        round.push(viewing::composite(gpu, &plan, &workspace)?);
        Ok(Self {
            gpu: Arc::clone(gpu),
            plan,
            workspace,
            refill,
            round,
            rounds: 1,
            step_excess: field.step_excess.clone(),
            staging: None,
            cost: ViewCost::default(),
        })
    }

    /// Bytes on the device that a renderer of a field takes besides its training, as `plan` has it.
    #[must_use]
    pub fn bytes_besides(plan: &Plan) -> u64 {
        let buffers = plan.for_views(&plan.features.lenses).viewing_buffers();
        buffers.iter().filter(|spec| !plan.lends(spec)).map(BufferSpec::bytes).sum()
    }

    /// Renders what `camera` sees.
    ///
    /// # Errors
    /// When the driver refuses a kernel, the device was lost, its interrupt was raised, or the camera has a lens that was not
    /// linked.
    pub fn render(&mut self, camera: &Camera) -> Result<View> {
        let (kind, lenses) = (camera.lens.kind(), &self.plan.features.lenses);
        if !lenses.contains(&kind) {
            let linked: Vec<_> = lenses.iter().map(|kind| kind.name()).collect();
            bail!(
                "this renderer was built for the lenses {}, and the camera's is {}; name all lenses when building it",
                linked.join(", "),
                kind.name()
            );
        }
        let step_excess = match &self.step_excess {
            StepExcess::Known(excess) => *excess,
            StepExcess::Counted(counters) => self.gpu.read::<Counters>(counters, 0, 1)?[0].step_excess,
        };
        let pixels = camera.width as usize * camera.height as usize;
        let mut view = View {
            width: camera.width,
            height: camera.height,
            color: Vec::with_capacity(pixels),
            depth: Vec::with_capacity(pixels),
        };
        let camera_in_box = field::DeviceCamera::in_box(camera, &self.plan.space);
        self.workspace.write(&self.gpu, "view_camera", &[camera_in_box]);
        while view.depth.len() < pixels {
            let band = self.plan.rounds.band.min(pixels - view.depth.len());
            let begin = Instant::now();
            self.render_band(view.depth.len()..view.depth.len() + band, step_excess)?;
            let host = self.add_pixels(&mut view, band)?;
            self.cost.host += host;
            self.cost.device += begin.elapsed().saturating_sub(host);
        }
        Ok(view)
    }

    /// Adds the pixels of the band that was rendered to a view; the time that took without waiting for the device.
    fn add_pixels(&mut self, view: &mut View, band: usize) -> Result<Duration> {
        let Self { gpu, plan, workspace, staging, .. } = self;
        let (grey, world_per_box) = (plan.features.grey, plan.space.world_per_box() as f32);
        let add = |pixels: &[viewing::Pixel]| {
            let begin = Instant::now();
            let color = |&[r, g, b, alpha, _]: &viewing::Pixel| [r * grey, g * grey, b * grey, alpha];
            view.color.par_extend(pixels.par_iter().with_min_len(PIXELS_AT_ONCE).map(color));
            let depth = |&[.., depth]: &viewing::Pixel| depth * world_per_box;
            view.depth.par_extend(pixels.par_iter().with_min_len(PIXELS_AT_ONCE).map(depth));
            begin.elapsed()
        };
        let bytes = (band * size_of::<viewing::Pixel>()) as u64;
        let staging = match staging.take().filter(|staging| staging.size() >= bytes) {
            Some(enough) => staging.insert(enough),
            None => staging.insert(gpu.staging::<viewing::Pixel>(band)?),
        };
        gpu.read_through(staging, workspace.get("view_pixels"), 0..band, add)
    }

    /// What the views since the last call took.
    pub fn take_cost(&mut self) -> ViewCost {
        std::mem::take(&mut self.cost)
    }

    /// Renders a band of pixels. As many rounds as the last band took are submitted before the device is asked whether
    /// rays are left, and few more at a time after that. At most two submissions are under way, so that a wish to stop is
    /// heard soon.
    fn render_band(&mut self, band: Range<usize>, step_excess: f32) -> Result<()> {
        self.begin_band(&band, step_excess)?;
        let rays = self.plan.capacity.rays;
        // A ray has a sample or more in each of its rounds, and no slot stays free.
        let most = (band.len() / rays + 1) * (self.plan.config.march.most_steps + 1);
        // Each pixel takes a slot in a round or more.
        let (mut submitted, mut more) = (0, self.rounds.max(band.len().div_ceil(rays)));
        let mut under_way = None;
        loop {
            for begun in (0..more).step_by(MOST_ROUNDS) {
                self.gpu.interrupt.check()?;
                let stages = self.round.iter().chain([&self.refill]);
                let rounds = repeat_n(stages, MOST_ROUNDS.min(more - begun)).flatten();
                let submission = self.gpu.run("rounds of a view", rounds, None)?;
                under_way.replace(submission).map_or(Ok(()), |earlier| self.gpu.wait_for(earlier))?;
            }
            submitted += more;
            let progress = self.workspace.read::<Progress>(&self.gpu, "progress", 1)?[0];
            if progress.rays == 0 && progress.rounds > 0 {
                self.rounds = progress.rounds as usize;
                self.cost.rounds += self.rounds;
                return Ok(());
            }
            if submitted > most || progress.rounds == 0 {
                bail!(
                    "the device left {} of {} rays unfinished after {submitted} rounds: its driver does not run the \
                     kernels as it should",
                    progress.rays,
                    band.len()
                );
            }
            more = submitted.div_ceil(8);
        }
    }

    /// Frees every slot, and gives each that is needed a pixel.
    fn begin_band(&self, band: &Range<usize>, step_excess: f32) -> Result<()> {
        let Self { gpu, workspace, .. } = self;
        let rays = self.plan.capacity.rays.min(band.len()) as u32;
        workspace.write(
            gpu,
            "counters",
            &[Counters { rays, step_excess: STEP_EXCESS * step_excess, ..Counters::default() }],
        );
        workspace.set_dispatch(gpu, dispatch::RAYS, rays as usize);
        let (begin, end) = (band.start as u32, band.end as u32);
        let progress =
            Progress { next_pixel: begin, band_begin: begin, band_end: end, ..Progress::default() };
        workspace.write(gpu, "progress", &[progress]);
        workspace.write(gpu, "view_slots", &vec![[0u32, 1]; rays as usize]);
        gpu.run("first round of a view", [&self.refill], None)?;
        Ok(())
    }
}
