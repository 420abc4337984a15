//! What only rendering needs: a view's rays and its compositing.

use super::{CAMERA, COUNTERS, Camera, EXP, Plan, RAY, RAY_STORE, STEP, SUM, Workspace, dispatch};
use crate::gpu::Gpu;
use crate::gpu::pass::Stage;
use anyhow::Result;

/// Allocates the camera and the results.
///
/// # Errors
/// When the adapter cannot hold them.
pub fn allocate(gpu: &Gpu, plan: &Plan, workspace: &mut Workspace) -> Result<()> {
    let rays = plan.config.batch.rays;
    workspace.add(gpu.storage::<Camera>("cameras", 1)?);
    workspace.add(gpu.storage::<[f32; 4]>("view_color", rays)?);
    workspace.add(gpu.storage::<f32>("view_depth", rays)?);
    Ok(())
}

/// The rays of a chunk of pixels.
///
/// # Errors
/// When the kernel cannot be built.
pub fn rays(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Stage> {
    let parts = [STEP, COUNTERS, RAY, RAY_STORE, CAMERA, part!("view_rays.wgsl")];
    let kernel = plan.kernel(gpu, "view rays", &parts)?;
    Ok(Stage::indirect(workspace.bind(gpu, &kernel, &[])?, workspace.get("dispatch"), dispatch::RAYS))
}

/// Colour, opacity and depth of the rays.
///
/// # Errors
/// When the kernel cannot be built.
pub fn composite(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Stage> {
    let parts = [COUNTERS, RAY, CAMERA, EXP, SUM, plan.transmittance(), part!("view_composite.wgsl")];
    let kernel = plan.kernel(gpu, "view composite", &parts)?;
    Ok(Stage::indirect(workspace.bind(gpu, &kernel, &[])?, workspace.get("dispatch"), dispatch::RAYS))
}
