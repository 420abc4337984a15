//! The backward pass: gradients of all activations, and of all weights.

use super::color::COLOR_HIDDEN;
use super::density::{layer_stage, quads};
use crate::field::capacity::SPARE_ROWS;
use crate::field::layout::{DENSITY_OUTPUTS, Layer};
use crate::field::shared::Tile;
use crate::field::sizes::WEIGHTS;
use crate::field::{Link, Plan, Workspace, dispatch};
use crate::gpu::Gpu;
use crate::gpu::buffer_spec::BufferSpec;
use crate::gpu::kernel::Kernel;
use crate::gpu::pass::Stage;
use crate::gpu::tensor::Element;
use anyhow::Result;

/// Names of the gradients in front of each hidden layer's ReLU in the colour network.
const D_COLOR_HIDDEN: [&str; 4] =
    ["d_color_hidden_1", "d_color_hidden_2", "d_color_hidden_3", "d_color_hidden_4"];

/// Gradients of activations, and partial sums of those of the weights.
pub(crate) fn buffers(plan: &Plan) -> Vec<BufferSpec> {
    let rows = plan.capacity.kept + SPARE_ROWS;
    let mut buffers = vec![
        plan.tensor("d_raw_color", Element::Vec4, rows),
        plan.tensor("d_density_out", Element::Vec4, rows * DENSITY_OUTPUTS / 4),
        plan.tensor("d_density_hidden", Element::Vec4, rows * plan.config.network.width / 4),
        plan.tensor("d_encoding", Element::Vec4, rows * plan.layout.encoding() / 4),
        plan.tensor("d_weight_chunks", Element::Vec4, plan.chunks * plan.layout.quads).sized_by(WEIGHTS),
    ];
    buffers.extend(plan.color_hidden(&D_COLOR_HIDDEN, rows));
    buffers
}

/// Gradients of all activations, from the colour back to the encoding.
///
/// # Errors
/// When a kernel cannot be built.
pub fn stages(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Vec<Stage>> {
    let last = plan.layout.color.len() - 1;
    let mut stages = Vec::new();
    for (number, layer) in plan.layout.color.iter().enumerate().rev() {
        let gradient = if number == last { "color" } else { "linear" };
        let (wanted, input, d_input, store) = match number {
            0 => (DENSITY_OUTPUTS, "color_input", "d_density_out", "features"),
            _ => (layer.inputs, COLOR_HIDDEN[number - 1], D_COLOR_HIDDEN[number - 1], "hidden"),
        };
        let d_output = if number == last { "d_raw_color" } else { D_COLOR_HIDDEN[number] };
        let renamed = [("layer_input", input), ("d_input", d_input), ("d_output", d_output)];
        let label = format!("d color {number}");
        let shape = (label.as_str(), layer, wanted);
        stages.push(backward_layer(gpu, plan, workspace, shape, [gradient, store], &renamed)?);
    }
    let [hidden, out] = [&plan.layout.density[0], &plan.layout.density[1]];
    let renamed =
        [("layer_input", "density_hidden"), ("d_input", "d_density_hidden"), ("d_output", "d_density_out")];
    let variants = ["linear", "hidden_of_sample"];
    stages.push(backward_layer(
        gpu,
        plan,
        workspace,
        ("d density out", out, out.inputs),
        variants,
        &renamed,
    )?);
    let renamed = [("d_input", "d_encoding"), ("d_output", "d_density_hidden")];
    let shape = ("d density hidden", hidden, hidden.inputs);
    stages.push(backward_layer(gpu, plan, workspace, shape, ["linear", "linear"], &renamed)?);
    Ok(stages)
}

fn backward_layer(
    gpu: &Gpu,
    plan: &Plan,
    workspace: &Workspace,
    (label, shape, wanted): (&str, &Layer, usize),
    [gradient, store]: [&str; 2],
    renamed: &[(&str, &str)],
) -> Result<Stage> {
    let link = Link::of_text(label, plan.product.backward(shape.inputs, wanted, shape.outputs));
    let link = link.with("layer_count", "kept").with("layer_gradient", gradient).with("layer_d_store", store);
    let kernel = plan.kernel(gpu, &link.counts(&quads(shape)))?;
    layer_stage(gpu, workspace, &kernel, shape, renamed, dispatch::KEPT_TILES)
}

/// Gradients of all weights.
///
/// # Errors
/// When a kernel cannot be built.
pub fn weights(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Vec<Stage>> {
    let mut jobs = vec![
        (&plan.layout.density[0], "encoding", "d_density_hidden", true),
        (&plan.layout.density[1], "density_hidden", "d_density_out", true),
    ];
    let last = plan.layout.color.len() - 1;
    for (number, shape) in plan.layout.color.iter().enumerate() {
        let input = if number == 0 { "color_input" } else { COLOR_HIDDEN[number - 1] };
        let d_output = if number == last { "d_raw_color" } else { D_COLOR_HIDDEN[number] };
        jobs.push((shape, input, d_output, false));
    }
    let mut kernels: Vec<(String, Kernel)> = Vec::new();
    let mut stages = Vec::new();
    for (shape, input, d_output, of_samples) in jobs {
        let text = plan.product.weight_gradient(shape.inputs, shape.outputs);
        if kernels.iter().all(|(known, _)| *known != text) {
            kernels.push((text.clone(), weight_kernel(gpu, plan, shape, &text)?));
        }
        for (_, kernel) in kernels.iter().filter(|(known, _)| *known == text) {
            let tile = Tile {
                input_quads: (shape.inputs / 4) as u32,
                first_quad: shape.first_quad as u32,
                of_samples: u32::from(of_samples),
                unused: 0,
            };
            let uniform = gpu.uniform("tile", &tile)?;
            let renamed = [("layer_input", input), ("d_output", d_output)];
            let bound = workspace.bind_with(gpu, kernel, &renamed, &[uniform.resource()])?;
            let threads = plan.product.weight_gradient_threads(shape.inputs, shape.outputs, plan.chunks);
            stages.push(Stage::over(bound, threads));
        }
    }
    Ok(stages)
}

/// The kernel for the weights of layers of this shape.
fn weight_kernel(gpu: &Gpu, plan: &Plan, shape: &Layer, text: &str) -> Result<Kernel> {
    let link = Link::of_text(&format!("d weights {}", shape.outputs), text.to_owned());
    plan.kernel(gpu, &link.with("layer_count", "kept"))
}
