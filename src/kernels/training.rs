//! What only training needs: rays with targets, the fused kernel, the backward pass and the optimiser.

use super::color::COLOR_HIDDEN;
use super::density::{layer_stage, quads};
use super::marching::{SPARE_ROWS, kept_capacity};
use super::{
    ADAM, CAMERA, COUNT_KEPT, COUNTERS, DENSITY, EXP, GRID, KEPT_LOAD, Part, Plan, RANDOM, RAY, RAY_RESULT,
    RAY_STORE, RAY_TARGET, RayResult, RayTarget, STEP, SUM, USABLE, Workspace, dispatch,
};
use crate::config::Accumulation;
use crate::gpu::Gpu;
use crate::gpu::demand::Demand;
use crate::gpu::kernel::Kernel;
use crate::gpu::pass::{Size, Stage};
use crate::gpu::tensor::{Element, Memory};
use crate::gpu_struct;
use crate::model::{DENSITY_OUTPUTS, Layer};
use anyhow::Result;

gpu_struct! {
    /// The shape of a layer whose weight gradient is summed; see `shaders/layer/tile.wgsl`.
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
pub(super) fn demands(plan: &Plan) -> Vec<Demand> {
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
    let parts = [
        RANDOM,
        STEP,
        COUNTERS,
        RAY,
        RAY_STORE,
        RAY_TARGET,
        CAMERA,
        plan.pixels(),
        plan.position(),
        plan.depth_target(),
        plan.background(),
        part!("rays.wgsl"),
    ];
    let kernel = plan.generated_kernel(gpu, "rays", &parts, &[], workspace.banks_part()?)?;
    Ok(Stage::indirect(workspace.bind(gpu, &kernel, &[])?, workspace.get("dispatch"), dispatch::RAYS))
}

/// The fused render, loss and gradient kernel.
///
/// # Errors
/// When the kernel cannot be built.
pub fn composite(gpu: &Gpu, plan: &Plan, workspace: &Workspace, weights: bool) -> Result<Stage> {
    let weights = if weights { part!("weights/stored.wgsl") } else { part!("weights/none.wgsl") };
    let mut parts = vec![
        COUNTERS,
        RAY_TARGET,
        RAY_RESULT,
        KEPT_LOAD,
        EXP,
        SUM,
        plan.transmittance(),
        plan.loss(),
        plan.depth_loss(),
        plan.distortion(),
        weights,
        part!("composite.wgsl"),
    ];
    parts.extend(plan.sparsity());
    plan.ray_stage(gpu, workspace, "composite", &parts)
}

/// Gradients of all activations, from the colour back to the encoding.
///
/// # Errors
/// When a kernel cannot be built.
pub fn backward(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Vec<Stage>> {
    let gradient = part!("layer/gradient.wgsl");
    let last = plan.layout.color.len() - 1;
    let mut stages = Vec::new();
    for (number, layer) in plan.layout.color.iter().enumerate().rev() {
        let mut parts = vec![COUNTERS, COUNT_KEPT];
        if number == last {
            parts.extend([EXP, plan.activation(), part!("layer/gradient_color.wgsl")]);
        } else {
            parts.push(gradient);
        }
        let (wanted, input, d_input) = if number == 0 {
            parts.extend([DENSITY, part!("layer/d_features.wgsl")]);
            (DENSITY_OUTPUTS, "color_input", "d_density_out")
        } else {
            parts.push(part!("layer/d_hidden.wgsl"));
            (layer.inputs, COLOR_HIDDEN[number - 1], D_COLOR_HIDDEN[number - 1])
        };
        let d_output = if number == last { "d_raw_color" } else { D_COLOR_HIDDEN[number] };
        let renamed = [("layer_input", input), ("d_input", d_input), ("d_output", d_output)];
        let label = format!("d color {number}");
        stages.push(backward_layer(gpu, plan, workspace, (&label, layer, wanted), &parts, &renamed)?);
    }
    let [hidden, out] = [&plan.layout.density[0], &plan.layout.density[1]];
    let parts = [COUNTERS, COUNT_KEPT, gradient, part!("layer/d_hidden_of_sample.wgsl")];
    let renamed =
        [("layer_input", "density_hidden"), ("d_input", "d_density_hidden"), ("d_output", "d_density_out")];
    stages.push(backward_layer(gpu, plan, workspace, ("d density out", out, out.inputs), &parts, &renamed)?);
    let parts = [COUNTERS, COUNT_KEPT, gradient, part!("layer/d_linear.wgsl")];
    let renamed = [("d_input", "d_encoding"), ("d_output", "d_density_hidden")];
    let shape = ("d density hidden", hidden, hidden.inputs);
    stages.push(backward_layer(gpu, plan, workspace, shape, &parts, &renamed)?);
    Ok(stages)
}

fn backward_layer(
    gpu: &Gpu,
    plan: &Plan,
    workspace: &Workspace,
    (label, shape, wanted): (&str, &Layer, usize),
    parts: &[Part],
    renamed: &[(&str, &str)],
) -> Result<Stage> {
    let text = plan.product.backward(shape.inputs, wanted, shape.outputs);
    let kernel = plan.generated_kernel(gpu, label, parts, &quads(shape), text)?;
    let size = Size::Indirect(workspace.get("dispatch").clone(), dispatch::KEPT_TILES);
    layer_stage(gpu, workspace, &kernel, shape, renamed, size)
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
            let groups = plan.product.weight_gradient_groups(shape.inputs, shape.outputs / 4, plan.chunks);
            stages.push(Stage::fixed(bound, groups, 1));
        }
    }
    Ok(stages)
}

/// The kernel for the weights of layers of `outputs` outputs.
fn weight_kernel(gpu: &Gpu, plan: &Plan, outputs: usize) -> Result<Kernel> {
    let parts = [COUNTERS, COUNT_KEPT, part!("layer/tile.wgsl")];
    let text = plan.product.weight_gradient(outputs / 4);
    plan.generated_kernel(gpu, &format!("d weights {outputs}"), &parts, &[], text)
}

/// Finds out whether the gradients can be used, scatters into the table, updates all parameters and ends the
/// step. A step whose gradients cannot be used changes nothing and is counted.
///
/// # Errors
/// When a kernel cannot be built.
pub fn update(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Vec<Stage>> {
    const MAGNITUDE: Part = part!("common/magnitude.wgsl");
    let [add, take] = plan.gradient();
    let mut scattering = [&[COUNTERS, GRID, USABLE, part!("common/corners.wgsl")], add.as_slice()].concat();
    if plan.accumulation != Accumulation::Ordered {
        scattering.push(part!("scatter.wgsl"));
    }
    let taking = [&[STEP, ADAM], take.as_slice(), &[part!("adam_table.wgsl")]].concat();
    let bind = |label: &str, parts: &[Part]| workspace.bind(gpu, &plan.kernel(gpu, label, parts)?, &[]);
    let range = bind("gradient range", &[COUNTERS, RAY_RESULT, MAGNITUDE, part!("gradient_range.wgsl")])?;
    let sums = bind("weight sums", &[MAGNITUDE, part!("weight_sums.wgsl")])?;
    let scatter = bind("scatter", &scattering)?;
    let table = bind("adam table", &taking)?;
    let mlp = bind("adam mlp", &[STEP, ADAM, USABLE, part!("adam_mlp.wgsl")])?;
    let finish = bind("finish", &[COUNTERS, RAY_RESULT, USABLE, part!("finish.wgsl")])?;
    let sizes = workspace.get("dispatch");
    let scatter = match plan.accumulation {
        Accumulation::Ordered => Stage::fixed(scatter, plan.layout.levels.len() / 8, 1),
        _ => Stage::indirect(scatter, sizes, dispatch::KEPT),
    };
    Ok(vec![
        Stage::indirect(range, sizes, dispatch::KEPT),
        Stage::fixed(sums, plan.layout.quads.div_ceil(8), 1),
        scatter,
        Stage::wide(table, plan.layout.entries.div_ceil(128)),
        Stage::fixed(mlp, plan.layout.quads.div_ceil(8), 1),
        Stage::fixed(finish, 1, 1),
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
