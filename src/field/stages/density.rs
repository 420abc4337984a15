//! The density network over all marched samples: encoding and two layers.

use crate::field::capacity::SPARE_ROWS;
use crate::field::layout::{DENSITY_OUTPUTS, Layer};
use crate::field::{Link, Plan, Workspace, dispatch};
use crate::gpu::Gpu;
use crate::gpu::buffer::Buffer;
use crate::gpu::buffer_spec::BufferSpec;
use crate::gpu::kernel::{Kernel, Resource};
use crate::gpu::pass::Stage;
use crate::gpu::tensor::Element;
use anyhow::Result;

/// The activations of the marched samples.
pub(crate) fn buffers(plan: &Plan) -> Vec<BufferSpec> {
    let rows = plan.capacity.samples + SPARE_ROWS;
    vec![
        plan.tensor("encoding", Element::Vec4, rows * plan.layout.encoding() / 4),
        plan.tensor("density_hidden", Element::Vec4, rows * plan.config.network.width / 4),
        plan.tensor("density_out", Element::Vec4, rows * DENSITY_OUTPUTS / 4),
    ]
}

/// Encodes the samples and runs the density network on them.
///
/// # Errors
/// When a kernel cannot be built.
pub fn stages(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Vec<Stage>> {
    let hidden = forward(gpu, plan, "density hidden", &plan.layout.density[0], ["samples", "hidden"])?;
    let out = forward(gpu, plan, "density out", &plan.layout.density[1], ["samples", "linear"])?;
    Ok(vec![
        plan.stage(gpu, workspace, &Link::of("encode"), dispatch::ENCODE)?,
        layer_stage(
            gpu,
            workspace,
            &hidden,
            &plan.layout.density[0],
            &[("layer_input", "encoding"), ("layer_output", "density_hidden")],
            dispatch::SAMPLE_TILES,
        )?,
        layer_stage(
            gpu,
            workspace,
            &out,
            &plan.layout.density[1],
            &[("layer_input", "density_hidden"), ("layer_output", "density_out")],
            dispatch::SAMPLE_TILES,
        )?,
    ])
}

/// The kernel of a forward layer: which rows it runs over, and where its outputs go.
///
/// # Errors
/// When it cannot be built.
pub fn forward(
    gpu: &Gpu,
    plan: &Plan,
    label: &str,
    layer: &Layer,
    [rows, store]: [&str; 2],
) -> Result<Kernel> {
    let link = Link::of_text(label, plan.product.forward(layer.inputs, layer.outputs));
    plan.kernel(gpu, &link.with("layer_count", rows).with("layer_store", store).counts(&quads(layer)))
}

/// The constants of a layer's shape.
#[must_use]
pub fn quads(layer: &Layer) -> [(&'static str, usize); 2] {
    [("INPUT_QUADS", layer.inputs / 4), ("OUTPUT_QUADS", layer.outputs / 4)]
}

/// A layer's kernel bound to its weights and to the `renamed` buffers, over one of [`dispatch`].
///
/// # Errors
/// When a buffer is missing.
pub fn layer_stage(
    gpu: &Gpu,
    workspace: &Workspace,
    kernel: &Kernel,
    layer: &Layer,
    renamed: &[(&str, &str)],
    over: usize,
) -> Result<Stage> {
    let weights = weights(workspace.get("mlp"), layer);
    workspace.stage(workspace.bind_with(gpu, kernel, renamed, &[weights])?, over)
}

fn weights<'a>(mlp: &'a Buffer, layer: &Layer) -> Resource<'a> {
    mlp.range("layer_weights", (layer.first_quad * 16) as u64, (layer.quads() * 16) as u64)
}
