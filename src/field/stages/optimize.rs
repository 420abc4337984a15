//! From gradients to parameters: their range, the scatter into the table, and Adam, group by group.

use crate::config::Accumulation;
use crate::field::parameters::{AdamKernel, Array, GROUPS, Learning};
use crate::field::sizes::ENTRIES;
use crate::field::{Link, Plan, Workspace, dispatch};
use crate::gpu::Gpu;
use crate::gpu::buffer_spec::BufferSpec;
use crate::gpu::kernel::Bound;
use crate::gpu::pass::Stage;
use crate::gpu::tensor::{Element, TensorMemory};
use anyhow::Result;

/// The gradients of the parameters, and their range.
pub(crate) fn buffers(plan: &Plan) -> Vec<BufferSpec> {
    let ordered = plan.accumulation == Accumulation::Ordered;
    let memory = if ordered { plan.memory } else { TensorMemory::Buffers };
    // Integers of 64 bits take twice the room of floats.
    let words = if plan.accumulation.is_of_integers() { 2 } else { 1 };
    let mut buffers = vec![
        BufferSpec::tensor("d_table", Element::Vec2, plan.layout.entries * words, memory).sized_by(ENTRIES),
        BufferSpec::storage::<u32>("gradient_range", 3),
    ];
    for (array, learning) in learnt(plan) {
        if let AdamKernel::Dense { gradients, .. } = learning.kernel {
            let spec = BufferSpec::storage::<f32>(gradients, array.count());
            buffers.push(spec.sized_by(array.spec(plan).sized_by));
        }
    }
    buffers
}

/// The groups that Adam learns and that have parameters.
fn learnt(plan: &Plan) -> impl Iterator<Item = (Array, &'static Learning)> {
    plan.arrays().filter_map(|array| {
        let group = GROUPS.iter().find(|group| group.name == array.name)?;
        Some((array, group.learning.as_ref()?))
    })
}

/// Finds out whether the gradients can be used, scatters into the table, updates all parameters and ends the
/// step. A step whose gradients cannot be used changes nothing and is counted.
///
/// # Errors
/// When a kernel cannot be built.
pub fn stages(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Vec<Stage>> {
    let bound = |link: &Link| workspace.bind(gpu, &plan.kernel(gpu, link)?, &[]);
    let mut stages = vec![plan.stage(gpu, workspace, &Link::of("gradient range"), dispatch::KEPT)?];
    for (array, learning) in learnt(plan) {
        if let AdamKernel::Dense { summed_by, .. } = learning.kernel {
            let link = Link::of(summed_by).float("L2", (learning.l2)(&plan.config.optimizer));
            stages.push(Stage::over(bound(&link)?, array.count() / 4));
        }
    }
    stages.push(scatter(gpu, plan, workspace)?);
    for (array, learning) in learnt(plan) {
        stages.push(adam(gpu, plan, workspace, &array, learning)?);
    }
    stages.push(Stage::single(bound(&Link::of("finish").with("counted", "written"))?));
    Ok(stages)
}

/// Adds the gradients of encodings to those of table entries.
fn scatter(gpu: &Gpu, plan: &Plan, workspace: &Workspace) -> Result<Stage> {
    let ordered = plan.accumulation == Accumulation::Ordered;
    let link = Link::of_file("scatter", if ordered { "scatter_ordered" } else { "scatter" });
    if !ordered {
        return plan.stage(gpu, workspace, &link, dispatch::SCATTER);
    }
    Ok(Stage::over(workspace.bind(gpu, &plan.kernel(gpu, &link)?, &[])?, plan.layout.levels.len()))
}

/// Adam on a group.
fn adam(gpu: &Gpu, plan: &Plan, workspace: &Workspace, array: &Array, learning: &Learning) -> Result<Stage> {
    let (name, count) = (array.name, array.count());
    let label = format!("adam {name}");
    let bind = |link: Link, renamed: &[(&str, &str)]| -> Result<Bound> {
        workspace.bind(gpu, &plan.kernel(gpu, &link.float("RATE", learning.rate))?, renamed)
    };
    Ok(match learning.kernel {
        // Two entries per thread.
        AdamKernel::Table => Stage::wide(bind(Link::of_file(&label, "adam_table"), &[])?, count / 2 / 2),
        AdamKernel::Dense { gradients, .. } => {
            let [first, second] = learning.moments();
            let renamed = [
                ("parameters", name),
                ("first_moments", first),
                ("second_moments", second),
                ("gradients", gradients),
            ];
            let link = Link::of_file(&label, "adam_dense").count("PARAMETER_QUADS", count / 4);
            Stage::over(bind(link, &renamed)?, count / 4)
        }
    })
}

/// Describes how the table's gradients are summed.
#[must_use]
pub fn accumulation_name(accumulation: Accumulation) -> &'static str {
    match accumulation {
        Accumulation::Fixed => "integer gradients",
        Accumulation::Long => "integer gradients in 64 bits",
        Accumulation::Ordered => "ordered gradients",
        Accumulation::Float => "float-atomic gradients",
        Accumulation::Auto | Accumulation::Exchange => "compare-exchange gradients",
    }
}
