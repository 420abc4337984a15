//! Drawing the rays of a step: pixels of photos, what they show, and what is behind it.

use crate::field::sizes::RAYS;
use crate::field::{Link, Plan, RayTarget, Workspace, dispatch, records};
use crate::gpu::Gpu;
use crate::gpu::buffer_spec::BufferSpec;
use crate::gpu::pass::Stage;
use anyhow::Result;

/// What the rays should show.
pub(crate) fn buffers(plan: &Plan) -> Vec<BufferSpec> {
    vec![BufferSpec::storage::<RayTarget>("ray_targets", plan.capacity.rays).sized_by(RAYS)]
}

/// Draws the rays of a step, from `cameras` cameras.
///
/// # Errors
/// When the kernel cannot be built.
pub fn stage(gpu: &Gpu, plan: &Plan, workspace: &Workspace, cameras: usize) -> Result<Stage> {
    let link = Link::of("rays").part(records::NAME, workspace.pages_part()?).count("CAMERA_COUNT", cameras);
    plan.stage(gpu, workspace, &link, dispatch::RAYS)
}
