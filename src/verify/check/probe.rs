//! Functions of the kernels on their own, in a kernel that only evaluates them.

use super::{CheckedAdapter, Setup};
use crate::camera::LensKind;
use crate::field::{Link, Workspace};
use crate::gpu::pass::Stage;
use anyhow::Result;

/// Functions of a few parts at many inputs.
pub(super) struct Probe<'a> {
    /// What the body needs, as a shader says it.
    pub(super) needs: &'a str,
    /// Variants of slots that are not the plan's.
    pub(super) variants: &'a [(&'a str, &'a str)],
    /// WGSL that reads `input(0u)` up to `input(INPUTS - 1)` and calls `output(i, value)`, each a `vec4<f32>`.
    pub(super) body: &'a str,
}

impl Probe<'_> {
    /// The outputs, `[cases, OUTPUTS]`, at inputs `[cases, INPUTS]`.
    pub(super) fn evaluate<const INPUTS: usize, const OUTPUTS: usize>(
        &self,
        adapter: &CheckedAdapter,
        inputs: &[[[f32; 4]; INPUTS]],
    ) -> Result<Vec<[[f32; 4]; OUTPUTS]>> {
        let gpu = &adapter.gpu;
        let mut setup = Setup::tiny();
        setup.features.lenses = LensKind::ALL.into();
        let plan = adapter.setup(setup).plan(gpu)?;
        let cases = inputs.len();
        let text = format!(
            "// needs: {}\n\
             var<storage, read> probe_inputs: array<vec4<f32>>;\n\
             var<storage, read_write> probe_outputs: array<vec4<f32>>;\n\
             var<private> probe_case: u32;\n\
             fn input(i: u32) -> vec4<f32> {{ return probe_inputs[probe_case * {INPUTS}u + i]; }}\n\
             fn output(i: u32, value: vec4<f32>) {{ probe_outputs[probe_case * {OUTPUTS}u + i] = value; }}\n\
             @compute @workgroup_size(64)\n\
             fn main(@builtin(global_invocation_id) id: vec3<u32>) {{\n\
                 if id.x >= {cases}u {{ return; }}\n\
                 probe_case = id.x;\n\
                 {}\n\
             }}\n",
            self.needs, self.body
        );
        let mut workspace = Workspace::default();
        workspace.add(gpu.storage_with("probe_inputs", inputs.as_flattened())?);
        workspace.add(gpu.storage::<[f32; 4]>("probe_outputs", cases * OUTPUTS)?);
        let link = Link::of_text("probe", text);
        let link = self.variants.iter().fold(link, |link, (slot, variant)| link.with(slot, variant));
        let kernel = plan.kernel(gpu, &link)?;
        let bound = workspace.bind(gpu, &kernel, &[])?;
        gpu.run("check", [&Stage::over(bound, cases)], None)?;
        let outputs: Vec<[f32; 4]> = workspace.read(gpu, "probe_outputs", cases * OUTPUTS)?;
        Ok(outputs.as_chunks().0.to_vec())
    }
}
