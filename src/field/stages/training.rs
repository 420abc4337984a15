//! What only training needs: rays with targets, the fused kernel, the backward pass and the optimiser.

use crate::config::Accumulation;
use crate::field::color::COLOR_HIDDEN;
use crate::field::density::{layer_stage, quads};
use crate::field::march::{SPARE_ROWS, kept_capacity};
use crate::field::parameters::{DENSITY_OUTPUTS, Layer};
use crate::field::{Link, Plan, RayResult, RayTarget, Workspace, dispatch, records};
use crate::gpu::Gpu;
use crate::gpu::demand::Demand;
use crate::gpu::kernel::Kernel;
use crate::gpu::pass::Stage;
use crate::gpu::tensor::{Element, Memory};
use crate::gpu_struct;
use anyhow::Result;

gpu_struct! {
    /// The shape of a layer whose weight gradient is summed; see `shaders/common/tile.wgsl`.
    Tile {
        /// Quads per row of inputs.
        input_quads: u32,
        /// First quad in the weight buffer.
        first_quad: u32,
        /// 1 when the inputs lie in the order of all marched samples.
        of_samples: u32,
        /// Padding.
        unused: u32,
    }
}

/// Names of the gradients in front of each hidden layer's ReLU in the colour network.
const D_COLOR_HIDDEN: [&str; 4] =
    ["d_color_hidden_1", "d_color_hidden_2", "d_color_hidden_3", "d_color_hidden_4"];

/// Targets, gradients and moments.
pub(crate) fn demands(plan: &Plan) -> Vec<Demand> {
    let (batch, layout) = (&plan.config.batch, &plan.layout);
    let rows = kept_capacity(&plan.config.batch) + SPARE_ROWS;
    let width = plan.config.network.width;
    let ordered = plan.accumulation == Accumulation::Ordered;
    let memory = if ordered { plan.memory } else { Memory::Buffers };
    // Integers of 64 bits take twice the room of floats.
    let words = if plan.accumulation == Accumulation::Fixed { 2 } else { 1 };
    let mut demands = vec![
        plan.tensor("kept_steps", Element::Vec4, 2 * rows),
        Demand::storage::<f32>("ray_tails", batch.rays),
        Demand::storage::<RayTarget>("ray_targets", batch.rays),
        Demand::storage::<RayResult>("ray_results", batch.rays),
        plan.tensor("d_color", Element::Vec4, rows),
        plan.tensor("d_raw_color", Element::Vec4, rows),
        plan.tensor("d_density_out", Element::Vec4, rows * DENSITY_OUTPUTS / 4),
        plan.tensor("d_density_hidden", Element::Vec4, rows * width / 4),
        plan.tensor("d_encoding", Element::Vec4, rows * layout.encoding() / 4),
        plan.tensor("d_weight_chunks", Element::Vec4, plan.chunks * layout.quads),
        plan.tensor("table_moments", Element::Vec4, layout.entries),
        Demand::tensor("d_table", Element::Vec2, layout.entries * words, memory),
        Demand::storage::<u32>("gradient_range", 3),
    ];
    demands.extend(plan.color_hidden(&D_COLOR_HIDDEN, rows));
    let of_weights = ["mlp_first", "mlp_second", "d_weights"];
    demands.extend(of_weights.map(|name| Demand::storage::<[f32; 4]>(name, layout.quads)));
    demands
}

/// Draws the rays of a step.
///
/// # Errors
/// When the kernel cannot be built.
pub fn rays(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Stage> {
    let link = Link::of("rays").part(records::NAME, workspace.banks_part()?);
    plan.stage(gpu, workspace, &link, dispatch::RAYS)
}

/// The fused render, loss and gradient kernel.
///
/// # Errors
/// When the kernel cannot be built.
pub fn composite(gpu: &Gpu, plan: &Plan, workspace: &Workspace, weights: bool) -> Result<Stage> {
    let weights = if weights { "stored" } else { "none" };
    plan.stage(gpu, workspace, &Link::of("composite").with("weights", weights), dispatch::RAYS)
}

/// Gradients of all activations, from the colour back to the encoding.
///
/// # Errors
/// When a kernel cannot be built.
pub fn backward(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Vec<Stage>> {
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
pub fn weight_gradients(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Vec<Stage>> {
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
    let mut kernels: Vec<(usize, Kernel)> = Vec::new();
    let mut stages = Vec::new();
    for (shape, input, d_output, of_samples) in jobs {
        if kernels.iter().all(|(outputs, _)| *outputs != shape.outputs) {
            kernels.push((shape.outputs, weight_kernel(gpu, plan, shape.outputs)?));
        }
        for (_, kernel) in kernels.iter().filter(|(outputs, _)| *outputs == shape.outputs) {
            let tile = Tile {
                input_quads: (shape.inputs / 4) as u32,
                first_quad: shape.first_quad as u32,
                of_samples: u32::from(of_samples),
                unused: 0,
            };
            let uniform = gpu.uniform("tile", &tile)?;
            let renamed = [("layer_input", input), ("d_output", d_output)];
            let bound = workspace.bind_with(gpu, kernel, &renamed, &[uniform.resource()])?;
            let threads = plan.product.weight_gradient_threads(shape.inputs, shape.outputs / 4, plan.chunks);
            stages.push(Stage::over(bound, threads));
        }
    }
    Ok(stages)
}

/// The kernel for the weights of layers of `outputs` outputs.
fn weight_kernel(gpu: &Gpu, plan: &Plan, outputs: usize) -> Result<Kernel> {
    let link = Link::of_text(&format!("d weights {outputs}"), plan.product.weight_gradient(outputs / 4));
    plan.kernel(gpu, &link.with("layer_count", "kept"))
}

/// Finds out whether the gradients can be used, scatters into the table, updates all parameters and ends the
/// step. A step whose gradients cannot be used changes nothing and is counted.
///
/// # Errors
/// When a kernel cannot be built.
pub fn update(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Vec<Stage>> {
    let bind = |link: &Link| workspace.bind(gpu, &plan.kernel(gpu, link)?, &[]);
    let range = bind(&Link::of("gradient range"))?;
    let sums = bind(&Link::of("weight sums"))?;
    let file = if plan.accumulation == Accumulation::Ordered { "scatter_ordered" } else { "scatter" };
    let scatter = bind(&Link::of_file("scatter", file))?;
    let table = bind(&Link::of("adam table"))?;
    let mlp = bind(&Link::of("adam mlp"))?;
    let finish = bind(&Link::of("finish").with("counted", "written"))?;
    let scatter = match plan.accumulation {
        Accumulation::Ordered => Stage::over(scatter, plan.layout.levels.len()),
        _ => workspace.stage(scatter, dispatch::KEPT)?,
    };
    Ok(vec![
        workspace.stage(range, dispatch::KEPT)?,
        Stage::over(sums, plan.layout.quads),
        scatter,
        Stage::wide(table, plan.layout.entries.div_ceil(2)),
        Stage::over(mlp, plan.layout.quads),
        Stage::single(finish),
    ])
}

/// Names of the tensors and buffers that hold the state of a training, apart from the counters.
pub const STATE: [&str; 6] = ["table", "table_moments", "mlp", "mlp_first", "mlp_second", "occupancy"];

/// Describes how the table's gradients are summed.
#[must_use]
pub fn accumulation_name(accumulation: Accumulation) -> &'static str {
    match accumulation {
        Accumulation::Fixed => "integer gradients",
        Accumulation::Ordered => "ordered gradients",
        Accumulation::Float => "float-atomic gradients",
        Accumulation::Auto | Accumulation::Exchange => "compare-exchange gradients",
    }
}
