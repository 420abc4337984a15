//! From rays to samples: marching through the occupancy grid, and the scan that packs the samples.

use super::{
    COUNTERS, Counters, MARCH_START, OCCUPANCY, Plan, RANDOM, RAY, RAY_LOAD, STEP, Step, Workspace, dispatch,
};
use crate::config::Batch;
use crate::gpu::Gpu;
use crate::gpu::pass::Stage;
use crate::gpu::tensor::Element;
use anyhow::Result;

/// Room behind the last sample for the rows that the last thread of a matrix product computes in vain.
pub const SPARE_ROWS: usize = 1024;

/// Allocates rays, their spans and the samples.
///
/// # Errors
/// When the adapter cannot hold them.
pub fn allocate(gpu: &Gpu, plan: &Plan, workspace: &mut Workspace) -> Result<()> {
    let batch = &plan.config.batch;
    workspace.add(gpu.uniform("step", &Step::default())?);
    workspace.add(gpu.storage::<Counters>("counters", 1)?);
    workspace.add(gpu.indirect("dispatch", dispatch::COUNT * 4)?);
    workspace.add(gpu.storage::<u32>("ray_steps", batch.rays * plan.step_words())?);
    workspace.add(gpu.storage::<[u32; 2]>("ray_spans", batch.rays)?);
    workspace.add(gpu.storage::<[u32; 2]>("kept_spans", batch.rays)?);
    let tensors = [
        ("ray_origins", Element::Vec4, batch.rays),
        ("ray_directions", Element::Vec4, batch.rays),
        ("samples", Element::Vec4, batch.samples + SPARE_ROWS),
    ];
    plan.allocate(gpu, workspace, &tensors)
}

/// Marches the rays and writes their samples; `jitter` shifts each ray's samples at random.
///
/// # Errors
/// When a kernel cannot be built.
pub fn stages(gpu: &Gpu, plan: &Plan, workspace: &Workspace, jitter: bool) -> Result<Vec<Stage>> {
    let jitter = if jitter { part!("common/jitter_on.wgsl") } else { part!("common/jitter_off.wgsl") };
    let stepping = plan.stepping();
    let march = plan.kernel(
        gpu,
        "march",
        &[
            RANDOM,
            STEP,
            COUNTERS,
            RAY,
            RAY_LOAD,
            OCCUPANCY,
            stepping,
            MARCH_START,
            jitter,
            part!("march.wgsl"),
        ],
    )?;
    let samples = plan.kernel(
        gpu,
        "samples",
        &[RANDOM, STEP, COUNTERS, RAY, RAY_LOAD, stepping, MARCH_START, jitter, part!("samples.wgsl")],
    )?;
    let sizes = workspace.get("dispatch");
    Ok(vec![
        Stage::indirect(workspace.bind(gpu, &march, &[])?, sizes, dispatch::RAYS),
        scan(gpu, plan, workspace, Scanned::Samples)?,
        Stage::indirect(workspace.bind(gpu, &samples, &[])?, sizes, dispatch::RAYS),
    ])
}

/// What a scan packs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scanned {
    /// The marched samples.
    Samples,
    /// The kept samples.
    Kept,
}

/// The scan over the rays' counts.
///
/// # Errors
/// When the kernel cannot be built.
pub fn scan(gpu: &Gpu, plan: &Plan, workspace: &Workspace, scanned: Scanned) -> Result<Stage> {
    let batch = &plan.config.batch;
    let (label, part, capacity, spans) = match scanned {
        Scanned::Samples => ("scan samples", part!("common/scan_samples.wgsl"), batch.samples, "ray_spans"),
        Scanned::Kept => ("scan kept", part!("common/scan_kept.wgsl"), kept_capacity(batch), "kept_spans"),
    };
    let parts = [COUNTERS, part, part!("scan.wgsl")];
    let kernel = plan.generated_kernel(gpu, label, &parts, &[("CAPACITY", capacity)], String::new())?;
    Ok(Stage::fixed(workspace.bind(gpu, &kernel, &[("ray_spans", spans)])?, 1, 1))
}

/// Most kept samples of a step: half as much again as the target, since the number of rays follows it only
/// from step to step.
#[must_use]
pub fn kept_capacity(batch: &Batch) -> usize {
    (batch.kept / 2 * 3).min(batch.samples)
}
