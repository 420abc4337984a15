//! From rays to samples: marching through the occupancy grid, and the scan that packs the samples.

use crate::field::capacity::SPARE_ROWS;
use crate::field::sizes::RAYS;
use crate::field::{Capacity, Counters, Link, Plan, Step, Workspace, dispatch};
use crate::gpu::Gpu;
use crate::gpu::buffer_spec::BufferSpec;
use crate::gpu::pass::Stage;
use crate::gpu::tensor::Element;
use anyhow::Result;

/// Rays, their spans and the samples.
pub(crate) fn buffers(plan: &Plan) -> Vec<BufferSpec> {
    let Capacity { rays, samples, .. } = plan.capacity;
    vec![
        BufferSpec::uniform::<Step>("step"),
        BufferSpec::uniform_storage::<Counters>("counters", 1),
        BufferSpec::indirect("dispatch", dispatch::COUNT * 4),
        BufferSpec::storage::<u32>("ray_steps", rays * plan.step_words()).sized_by(RAYS),
        BufferSpec::storage::<[u32; 2]>("ray_spans", rays).sized_by(RAYS),
        BufferSpec::storage::<[u32; 2]>("kept_spans", rays).sized_by(RAYS),
        plan.tensor("ray_lines", Element::Vec4, 2 * rays).sized_by(RAYS),
        plan.tensor("samples", Element::Vec4, samples + SPARE_ROWS),
    ]
}

/// How far rays are marched at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MarchExtent {
    /// To the end of the box.
    Whole,
    /// From where the round before ended, up to as many samples as the round allows: a
    /// [`crate::field::viewing`] ray knows its first step in this round and in the next, [`crate::field::Progress::quota`] the most samples of a ray.
    Round,
}

impl MarchExtent {
    fn variant(self) -> &'static str {
        match self {
            Self::Whole => "whole",
            Self::Round => "round",
        }
    }
}

/// Marches the rays to their ends and writes their samples; `jitter` shifts each ray's samples at random.
///
/// # Errors
/// When a kernel cannot be built.
pub fn stages(gpu: &Gpu, plan: &Plan, workspace: &Workspace, jitter: bool) -> Result<Vec<Stage>> {
    stages_over(gpu, plan, workspace, jitter, MarchExtent::Whole)
}

/// As [`stages`], over an extent of the rays.
///
/// # Errors
/// When a kernel cannot be built.
pub fn stages_over(
    gpu: &Gpu,
    plan: &Plan,
    workspace: &Workspace,
    jitter: bool,
    extent: MarchExtent,
) -> Result<Vec<Stage>> {
    let jitter = if jitter { "on" } else { "off" };
    let over_rays = |label: &str| {
        let link = Link::of(label).with("jitter", jitter).with("extent", extent.variant());
        let lanes = if extent == MarchExtent::Whole { plan.march_lanes } else { 1 };
        let link = link.count("MARCH_LANES", lanes);
        let link = if extent == MarchExtent::Round { link.with("distance", "depth") } else { link };
        plan.stage(gpu, workspace, &link, dispatch::RAYS)
    };
    Ok(vec![over_rays("march")?, scan(gpu, plan, workspace, Scanned::Samples)?, over_rays("samples")?])
}

/// What a scan packs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scanned {
    /// The marched samples.
    Samples,
    /// The kept samples.
    Kept,
    /// The slots of a view's rays that are free.
    Free,
}

/// The scan over the rays' counts.
///
/// # Errors
/// When the kernel cannot be built.
pub fn scan(gpu: &Gpu, plan: &Plan, workspace: &Workspace, scanned: Scanned) -> Result<Stage> {
    let Capacity { rays, samples, kept } = plan.capacity;
    let (variant, capacity, spans) = match scanned {
        Scanned::Samples => ("samples", samples, "ray_spans"),
        Scanned::Kept => ("kept", kept, "kept_spans"),
        Scanned::Free => ("free", rays, "view_slots"),
    };
    let link = Link::of_file(&format!("scan {variant}"), "scan");
    let link = link.with("scanned", variant).with("counted", "written").count("CAPACITY", capacity);
    let kernel = plan.kernel(gpu, &link)?;
    Ok(Stage::single(workspace.bind(gpu, &kernel, &[("ray_spans", spans)])?))
}
