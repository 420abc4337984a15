//! What only rendering needs: how much of a view is in work at once, its rays and their compositing.

use crate::field::{Camera, Link, Plan, Progress, SceneFeatures, Traits, Workspace};
use crate::gpu::Gpu;
use crate::gpu::demand::Demand;
use crate::gpu::pass::Stage;
use crate::gpu::tensor::Element;
use anyhow::Result;

/// How much of a view is in work at once. Rays are marched front to back in rounds of a few samples; one that ended
/// makes room for the next pixel's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rounds {
    /// Rays in work.
    pub rays: usize,
    /// Samples of a round, at least one for each ray; fewer rays may ask for more each.
    pub samples: usize,
    /// Most samples of a ray in a round: those behind an opaque surface are computed in vain.
    pub most_quota: usize,
    /// Most pixels between two read-backs.
    pub band: usize,
    /// Samples get colour wherever the weights since the last one sum to this, and stand for those in between.
    pub color_weight: f64,
}

/// Premultiplied colour without background, opacity, and mean depth in box units, as `view_composite.wgsl` writes them.
pub type Pixel = [f32; 5];

/// What does not show in 32 bits.
pub const LEAST_WEIGHT: f64 = 1e-12;

impl Rounds {
    /// What suits an adapter: few samples in vain on a CPU, few rounds on a GPU.
    pub(crate) fn suited_to(adapter: Traits) -> Self {
        if adapter.is_cpu {
            Self { rays: 1 << 13, samples: 1 << 15, most_quota: 16, band: 1 << 20, color_weight: 1e-3 }
        } else {
            Self { rays: 1 << 15, samples: 1 << 18, most_quota: 64, band: 1 << 22, color_weight: 1e-3 }
        }
    }

    /// The weight of a colour. Without a bound on the colours there is none on the error of one that stands for
    /// others: in linear light every sample has its own.
    pub(crate) fn color_weight(&self, needs: &SceneFeatures) -> f64 {
        if needs.hdr { LEAST_WEIGHT } else { self.color_weight }
    }
}

/// The camera, the state of the rays and the pixels of a band.
#[must_use]
pub fn demands(plan: &Plan) -> Vec<Demand> {
    let (rays, band) = (plan.config.batch.rays, plan.rounds.band);
    vec![
        Demand::uniform::<Camera>("view_camera"),
        Demand::uniform_storage::<Progress>("progress", 1),
        Demand::storage::<[u32; 2]>("view_slots", rays),
        Demand::storage::<[u32; 3]>("view_rays", rays),
        plan.tensor("ray_states", Element::Vec4, 2 * rays),
        Demand::storage::<Pixel>("view_pixels", band),
    ]
}

/// Begins rays where slots are free.
///
/// # Errors
/// When the kernel cannot be built.
pub fn rays(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Stage> {
    plan.ray_stage(gpu, workspace, &Link::of("view rays"))
}

/// Chooses the samples that get colour.
///
/// # Errors
/// When the kernel cannot be built.
pub(crate) fn select(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Stage> {
    plan.ray_stage(gpu, workspace, &Link::of("view select"))
}

/// Adds their colours, and writes the pixels of rays that ended.
///
/// # Errors
/// When the kernel cannot be built.
pub fn composite(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Stage> {
    plan.ray_stage(gpu, workspace, &Link::of("view composite"))
}
