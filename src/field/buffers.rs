//! The buffers that a plan needs on the device, listed before anything is allocated.

use super::layout::Level;
use super::sizes::SAMPLES;
use super::{
    Capabilities, Field, Plan, Workspace, backward, color, composite, density, march, occupancy, optimize,
    rays, viewing,
};
use crate::gpu::Gpu;
use crate::gpu::buffer_spec::BufferSpec;
use crate::gpu::tensor::Element;
use anyhow::{Result, anyhow};

/// What a step leaves for the next one.
const CARRIED: [&str; 3] = ["step", "counters", "dispatch"];

impl Plan {
    /// Whether the adapter can train the field of this plan and render its views.
    ///
    /// # Errors
    /// When it cannot: says what it lacks, and what to change.
    pub fn check(&self, gpu: &Gpu) -> Result<()> {
        Capabilities::of(gpu).check(self.accumulation, &gpu.info.name)?;
        let buffers = self
            .training_buffers(self.cell_count())
            .into_iter()
            .chain(self.for_views(&self.features.lenses).viewing_buffers());
        for spec in buffers {
            let setting = if spec.sized_by.is_empty() { SAMPLES } else { spec.sized_by };
            spec.check(gpu).map_err(|error| anyhow!("{error}; use a smaller {setting}"))?;
        }
        Ok(())
    }

    /// Everything but the photos that a training run needs, which visits `visible` cells of its occupancy grid.
    #[must_use]
    pub fn training_buffers(&self, visible: usize) -> Vec<BufferSpec> {
        [self.field_buffers(true), self.step_buffers(visible)].concat()
    }

    /// What the steps of a training run need besides the field and the photos.
    fn step_buffers(&self, visible: usize) -> Vec<BufferSpec> {
        [
            rays::buffers(self),
            march::buffers(self),
            density::buffers(self),
            color::buffers(self),
            composite::buffers(self),
            backward::buffers(self),
            optimize::buffers(self),
            occupancy::buffers(visible),
        ]
        .concat()
    }

    /// The field: what describes its levels, and all of its arrays or those that rendering reads.
    pub(super) fn field_buffers(&self, is_whole: bool) -> Vec<BufferSpec> {
        let levels = BufferSpec::uniform_storage::<Level>("levels", self.layout.levels.len());
        let arrays = self.arrays().filter(|array| array.rendered || is_whole);
        [levels].into_iter().chain(arrays.map(|array| array.spec(self))).collect()
    }

    /// What rendering needs besides the parameters, as the plan of a renderer.
    #[must_use]
    pub fn viewing_buffers(&self) -> Vec<BufferSpec> {
        [march::buffers(self), density::buffers(self), color::buffers(self), viewing::buffers(self)].concat()
    }

    /// Whether views may keep `spec` where the steps of this plan have theirs: it is as large there, and what one step
    /// leaves there is not read by the next.
    pub(super) fn lends(&self, spec: &BufferSpec) -> bool {
        !CARRIED.contains(&spec.name) && self.step_buffers(0).iter().any(|own| own.holds(spec))
    }

    /// A tensor in the plan's memory.
    pub(super) fn tensor(&self, name: &'static str, element: Element, count: usize) -> BufferSpec {
        BufferSpec::tensor(name, element, count, self.memory)
    }

    /// One tensor of `rows` rows per hidden layer of the colour network.
    pub(super) fn color_hidden(&self, names: &'static [&'static str], rows: usize) -> Vec<BufferSpec> {
        let count = rows * self.config.network.width / 4;
        let layers = self.config.network.color_layers;
        names.iter().take(layers).map(|name| self.tensor(name, Element::Vec4, count)).collect()
    }
}

impl Workspace {
    /// Room for training steps of `field`, whichever cells of its occupancy grid they visit; the photos are added later.
    ///
    /// # Errors
    /// When the adapter cannot hold it.
    pub fn for_training(field: &Field) -> Result<Self> {
        let (gpu, plan) = (field.gpu(), field.plan());
        let mut workspace = Self::default();
        workspace.share(&field.arrays);
        workspace.allocate(gpu, &plan.step_buffers(plan.cell_count()))?;
        Ok(workspace)
    }
}
