//! Choosing the samples that matter, and the colour network over them.

use crate::field::capacity::SPARE_ROWS;
use crate::field::density::{forward, layer_stage};
use crate::field::layout::COLOR_INPUTS;
use crate::field::march::{Scanned, scan};
use crate::field::{Link, Plan, Workspace, dispatch, viewing};
use crate::gpu::Gpu;
use crate::gpu::buffer_spec::BufferSpec;
use crate::gpu::pass::Stage;
use crate::gpu::tensor::Element;
use anyhow::Result;

/// Names of the activations behind each hidden layer of the colour network.
pub const COLOR_HIDDEN: [&str; 4] = ["color_hidden_1", "color_hidden_2", "color_hidden_3", "color_hidden_4"];

/// How many samples get colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SelectionMode {
    /// Those above the weight floor, and some of the others.
    Training,
    /// Of a view's rays, one for every [`crate::field::Rounds`].
    View,
}

/// The kept samples and the colour network's activations.
pub(crate) fn buffers(plan: &Plan) -> Vec<BufferSpec> {
    let rows = plan.capacity.kept + SPARE_ROWS;
    let mut buffers = vec![
        plan.tensor("chosen", Element::Vec4, plan.capacity.samples),
        plan.tensor("kept_rows", Element::Vec2u, rows),
        plan.tensor("color_input", Element::Vec4, rows * COLOR_INPUTS / 4),
        plan.tensor("color", Element::Vec4, rows),
    ];
    buffers.extend(plan.color_hidden(&COLOR_HIDDEN, rows));
    buffers
}

/// Selects, packs and colours.
///
/// # Errors
/// When a kernel cannot be built.
pub fn stages(gpu: &Gpu, plan: &Plan, workspace: &Workspace, selection: SelectionMode) -> Result<Vec<Stage>> {
    let (mut stages, packing) = match selection {
        SelectionMode::Training => {
            let opacities = plan.stage(gpu, workspace, &Link::of("opacities"), dispatch::SAMPLES)?;
            (vec![opacities, plan.stage(gpu, workspace, &Link::of("select"), dispatch::RAYS)?], "training")
        }
        SelectionMode::View => (vec![viewing::select(gpu, plan, workspace)?], "view"),
    };
    let kept = plan.stage(gpu, workspace, &Link::of("kept").with("packing", packing), dispatch::RAYS)?;
    let input = plan.stage(gpu, workspace, &Link::of("color input"), dispatch::KEPT)?;
    stages.extend([scan(gpu, plan, workspace, Scanned::Kept)?, kept, input]);
    stages.extend(network(gpu, plan, workspace)?);
    Ok(stages)
}

/// The colour network's layers.
fn network(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Vec<Stage>> {
    let layers = &plan.layout.color;
    let last = layers.len() - 1;
    let mut source = "color_input";
    let mut stages = Vec::new();
    for (number, layer) in layers.iter().enumerate() {
        let label = format!("color {number}");
        let (store, output) =
            if number == last { ("color", "color") } else { ("hidden", COLOR_HIDDEN[number]) };
        let kernel = forward(gpu, plan, &label, layer, ["kept", store])?;
        let renamed = [("layer_input", source), ("layer_output", output)];
        stages.push(layer_stage(gpu, workspace, &kernel, layer, &renamed, dispatch::KEPT_TILES)?);
        source = output;
    }
    Ok(stages)
}
