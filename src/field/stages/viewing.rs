//! What only rendering needs: its rays and their compositing.

use crate::field::{DeviceCamera, Link, Plan, Progress, Workspace, dispatch};
use crate::gpu::Gpu;
use crate::gpu::buffer_spec::BufferSpec;
use crate::gpu::pass::Stage;
use crate::gpu::tensor::Element;
use anyhow::Result;

/// Premultiplied colour without background, opacity, and mean depth in box units, as `view_composite.wgsl` writes them.
pub type Pixel = [f32; 5];

/// The camera, the state of the rays and the pixels of a band.
#[must_use]
pub fn buffers(plan: &Plan) -> Vec<BufferSpec> {
    let (rays, band) = (plan.capacity.rays, plan.rounds.band);
    vec![
        BufferSpec::uniform::<DeviceCamera>("view_camera"),
        BufferSpec::uniform_storage::<Progress>("progress", 1),
        BufferSpec::storage::<[u32; 2]>("view_slots", rays),
        BufferSpec::storage::<[u32; 3]>("view_rays", rays),
        plan.tensor("ray_states", Element::Vec4, 2 * rays),
        BufferSpec::storage::<f32>("sample_distances", plan.capacity.samples),
        BufferSpec::storage::<Pixel>("view_pixels", band),
    ]
}

/// Begins rays where slots are free.
///
/// # Errors
/// When the kernel cannot be built.
pub fn rays(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Stage> {
    plan.stage(gpu, workspace, &Link::of("view rays"), dispatch::RAYS)
}

/// Chooses the samples that get colour.
///
/// # Errors
/// When the kernel cannot be built.
pub(crate) fn select(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Stage> {
    plan.stage(gpu, workspace, &Link::of("view select").with("distance", "depth"), dispatch::RAYS)
}

/// Adds their colours, and writes the pixels of rays that ended.
///
/// # Errors
/// When the kernel cannot be built.
pub fn composite(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Stage> {
    plan.stage(gpu, workspace, &Link::of("view composite"), dispatch::RAYS)
}
