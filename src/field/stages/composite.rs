//! The fused render, loss and gradient kernel.

use crate::field::capacity::SPARE_ROWS;
use crate::field::sizes::RAYS;
use crate::field::{Capacity, Link, Plan, RayResult, Workspace, dispatch};
use crate::gpu::Gpu;
use crate::gpu::buffer_spec::BufferSpec;
use crate::gpu::pass::Stage;
use crate::gpu::tensor::Element;
use anyhow::Result;

/// What it takes of kept samples and rays, what the rays show, and the gradients of colours and log-densities.
pub(crate) fn buffers(plan: &Plan) -> Vec<BufferSpec> {
    let Capacity { rays, samples, kept } = plan.capacity;
    let rows = kept + SPARE_ROWS;
    let mut buffers = vec![
        plan.tensor("kept_steps", Element::Vec4, 2 * rows),
        BufferSpec::storage::<f32>("ray_tails", rays).sized_by(RAYS),
        BufferSpec::storage::<RayResult>("ray_results", rays).sized_by(RAYS),
        plan.tensor("d_color", Element::Vec4, rows),
    ];
    if plan.needs_distances() {
        buffers.push(BufferSpec::storage::<f32>("sample_distances", samples));
    }
    buffers
}

/// The kernel; `weights` asks for the samples' weights too.
///
/// # Errors
/// When it cannot be built.
pub fn stage(gpu: &Gpu, plan: &Plan, workspace: &Workspace, weights: bool) -> Result<Stage> {
    let weights = if weights { "stored" } else { "none" };
    plan.stage(gpu, workspace, &Link::of("composite").with("weights", weights), dispatch::RAYS)
}
