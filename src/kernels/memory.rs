//! What a plan needs on the device, told before anything is allocated.

use super::{Plan, Workspace, color, density, marching, occupancy, training, viewing};
use crate::gpu::Gpu;
use crate::gpu::demand::Demand;
use crate::gpu::tensor::Element;
use anyhow::Result;

impl Plan {
    /// Everything but the photos that a training needs, which visits `visible` cells of its occupancy grid.
    #[must_use]
    pub fn training_demands(&self, visible: usize) -> Vec<Demand> {
        [
            marching::demands(self),
            density::parameter_demands(self),
            density::demands(self),
            color::demands(self),
            training::demands(self),
            occupancy::demands(visible),
        ]
        .concat()
    }

    /// What rendering needs besides the parameters.
    #[must_use]
    pub fn viewing_demands(&self) -> Vec<Demand> {
        [marching::demands(self), density::demands(self), color::demands(self), viewing::demands(self)]
            .concat()
    }

    /// A tensor in the plan's memory.
    pub(super) fn tensor(&self, name: &'static str, element: Element, count: usize) -> Demand {
        Demand::tensor(name, element, count, self.memory)
    }

    /// One tensor of `rows` rows per hidden layer of the colour network.
    pub(super) fn color_hidden(&self, names: &'static [&'static str], rows: usize) -> Vec<Demand> {
        let count = rows * self.config.network.width / 4;
        let layers = self.config.network.color_layers;
        names.iter().take(layers).map(|name| self.tensor(name, Element::Vec4, count)).collect()
    }
}

impl Workspace {
    /// Room for a training that visits the cells `visible` of its occupancy grid; the photos are added later.
    ///
    /// # Errors
    /// When the adapter cannot hold it.
    pub fn for_training(gpu: &Gpu, plan: &Plan, visible: &[u32]) -> Result<Self> {
        let mut workspace = Self::default();
        workspace.allocate(gpu, &plan.training_demands(visible.len()))?;
        workspace.write(gpu, "levels", &plan.layout.levels);
        workspace.write(gpu, "visible_cells", visible);
        Ok(workspace)
    }
}
