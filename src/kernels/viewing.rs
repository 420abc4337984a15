//! What only rendering needs: a view's rays and its compositing.

use super::{CAMERA, COUNTERS, Camera, EXP, Plan, RAY, RAY_STORE, STEP, SUM, Workspace, dispatch};
use crate::gpu::Gpu;
use crate::gpu::demand::Demand;
use crate::gpu::pass::Stage;
use anyhow::Result;

/// The camera and the results.
#[must_use]
pub fn demands(plan: &Plan) -> Vec<Demand> {
    let rays = plan.config.batch.rays;
    vec![
        Demand::storage::<Camera>("cameras", 1),
        Demand::storage::<[f32; 4]>("view_color", rays),
        Demand::storage::<f32>("view_depth", rays),
    ]
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
