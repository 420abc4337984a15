//! The parameter groups of a field: one table, from which buffers, the state of a training run, checkpoints, memory and Adam
//! follow. One group more is one row here, and its kernels.

use super::Plan;
use super::layout::{FEATURES, Layout};
use super::sizes::{CELLS, ENTRIES, WEIGHTS};
use crate::config::Optimizer;
use crate::gpu::buffer_spec::BufferSpec;
use crate::gpu::tensor::Element;

/// A group of parameters.
pub struct ParameterGroup {
    /// What kernels and checkpoints call it.
    pub name: &'static str,
    place: ArrayStorage,
    /// The shape of its numbers.
    shape: fn(&Plan) -> Vec<usize>,
    start: InitialValue,
    /// Whether rendering reads it.
    rendered: bool,
    /// What its size follows from.
    sized_by: &'static str,
    /// How Adam learns it; `None` for what is measured instead.
    pub learning: Option<Learning>,
}

/// How Adam learns a group.
pub struct Learning {
    /// Its learning rate, as a multiple of the schedule's.
    pub rate: f64,
    /// Its L2 regularisation, which the kernel that sums its gradients adds as `L2`.
    pub l2: fn(&Optimizer) -> f64,
    /// The numbers that Adam keeps of it: what they are called, where they are, and how many there are per parameter.
    moments: &'static [(&'static str, ArrayStorage, usize)],
    /// Its kernel.
    pub kernel: AdamKernel,
}

impl Learning {
    /// What the first and the second moments are called; the same where they share an array.
    #[must_use]
    pub fn moments(&self) -> [&'static str; 2] {
        let name =
            |number: usize| self.moments.get(number.min(self.moments.len() - 1)).map_or("", |row| row.0);
        [name(0), name(1)]
    }
}

/// A kernel of Adam.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdamKernel {
    /// `adam_table.wgsl`: leaves alone what no gradient touched.
    Table,
    /// `adam_dense.wgsl`: all, with two arrays of moments.
    Dense {
        /// The buffer of the gradients, as large as the group.
        gradients: &'static str,
        /// The kernel that sums them and adds the regularisation L2, and raises `gradient_range[1]` to their magnitude.
        summed_by: &'static str,
    },
}

/// Where the numbers of an array are on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ArrayStorage {
    /// In a tensor.
    Tensor(Element),
    /// In a buffer that kernels read as uniform.
    Uniform,
    /// In a storage buffer.
    Storage,
}

/// What an array holds before the first step.
#[derive(Clone, Copy)]
enum InitialValue {
    /// Zeros.
    Zeros,
    /// Numbers drawn from a seed.
    Drawn(fn(&Layout, u32) -> Vec<f32>),
    /// What follows from the cells that nothing can be in.
    Cells(fn(&Plan, &[bool]) -> Numbers),
}

/// The table.
pub static GROUPS: &[ParameterGroup] = &[
    ParameterGroup {
        name: "table",
        place: ArrayStorage::Tensor(Element::Vec2),
        shape: |plan| vec![plan.layout.entries, FEATURES],
        start: InitialValue::Drawn(Layout::initial_table),
        rendered: true,
        sized_by: ENTRIES,
        learning: Some(Learning {
            rate: 1.0,
            l2: |_| 0.0,
            // The first of both features, then the second.
            moments: &[("table_moments", ArrayStorage::Tensor(Element::Vec4), 2)],
            kernel: AdamKernel::Table,
        }),
    },
    ParameterGroup {
        name: "mlp",
        place: ArrayStorage::Uniform,
        shape: |plan| vec![plan.layout.quads, 4],
        start: InitialValue::Drawn(Layout::initial_weights),
        rendered: true,
        sized_by: WEIGHTS,
        learning: Some(Learning {
            rate: 1.0,
            l2: |optimizer| optimizer.l2,
            moments: &[("mlp_first", ArrayStorage::Storage, 1), ("mlp_second", ArrayStorage::Storage, 1)],
            kernel: AdamKernel::Dense { gradients: "d_weights", summed_by: "weight sums" },
        }),
    },
    ParameterGroup {
        name: "occupancy",
        place: ArrayStorage::Storage,
        shape: |plan| plan.space.grid_shape(plan.config.occupancy.cells).to_vec(),
        start: InitialValue::Cells(occupancy),
        rendered: false,
        sized_by: CELLS,
        learning: None,
    },
    ParameterGroup {
        name: "occupancy_bits",
        place: ArrayStorage::Tensor(Element::U32),
        shape: |plan| vec![plan.cell_count() / 32],
        start: InitialValue::Cells(occupancy_bits),
        rendered: true,
        sized_by: CELLS,
        learning: None,
    },
];

/// Optical depths over the least step. The networks begin with a log-density of about 0; cells that nothing can be in have
/// -1.
fn occupancy(plan: &Plan, hidden: &[bool]) -> Numbers {
    let initial = plan.least_step() as f32;
    Numbers::Floats(hidden.iter().map(|&hidden| if hidden { -1.0 } else { initial }).collect())
}

fn occupancy_bits(_: &Plan, hidden: &[bool]) -> Numbers {
    let word = |cells: &[bool]| (0..32).fold(0, |word, bit| word | (u32::from(!cells[bit]) << bit));
    Numbers::Words(hidden.chunks_exact(32).map(word).collect())
}

/// The numbers of an array.
#[derive(Clone, Debug, PartialEq)]
pub enum Numbers {
    /// Floats.
    Floats(Vec<f32>),
    /// Words.
    Words(Vec<u32>),
}

impl Numbers {
    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        match self {
            Self::Floats(numbers) => numbers.len(),
            Self::Words(numbers) => numbers.len(),
        }
    }

    /// The floats; none of words.
    #[must_use]
    pub fn floats(&self) -> &[f32] {
        match self {
            Self::Floats(numbers) => numbers,
            Self::Words(_) => &[],
        }
    }
}

/// An array that the state of a training run has: the parameters of a group, or what Adam keeps of them.
#[derive(Clone)]
pub struct Array {
    /// What kernels and checkpoints call it.
    pub name: &'static str,
    /// The shape of its numbers, of 32 bits each.
    pub shape: Vec<usize>,
    /// Whether rendering reads it.
    pub rendered: bool,
    place: ArrayStorage,
    start: InitialValue,
    sized_by: &'static str,
}

impl Array {
    /// How many numbers it has.
    #[must_use]
    pub fn count(&self) -> usize {
        self.shape.iter().product()
    }

    /// Whether its numbers are words.
    #[must_use]
    pub fn has_words(&self) -> bool {
        self.place == ArrayStorage::Tensor(Element::U32)
    }

    /// What it holds before the first step of a training run where nothing can be in the `hidden` cells.
    #[must_use]
    pub fn start(&self, plan: &Plan, hidden: &[bool]) -> Numbers {
        match self.start {
            InitialValue::Zeros => Numbers::Floats(vec![0.0; self.count()]),
            InitialValue::Drawn(draw) => Numbers::Floats(draw(&plan.layout, plan.config.seed)),
            InitialValue::Cells(from) => from(plan, hidden),
        }
    }

    /// Its room on the device.
    #[must_use]
    pub fn spec(&self, plan: &Plan) -> BufferSpec {
        let spec = match self.place {
            ArrayStorage::Tensor(element) => {
                plan.tensor(self.name, element, self.count() * 4 / element.bytes())
            }
            ArrayStorage::Uniform => BufferSpec::uniform_storage::<u32>(self.name, self.count()),
            ArrayStorage::Storage => BufferSpec::storage::<u32>(self.name, self.count()),
        };
        spec.sized_by(self.sized_by)
    }
}

impl Plan {
    /// The arrays of the state of a training run, group by group. A group without numbers has none.
    pub fn arrays(&self) -> impl Iterator<Item = Array> {
        GROUPS.iter().flat_map(|group| {
            let shape = (group.shape)(self);
            let ParameterGroup { name, place, start, rendered, sized_by, .. } = *group;
            let own = Array { name, shape: shape.clone(), rendered, place, start, sized_by };
            let moments = group.learning.iter().flat_map(|learning| learning.moments);
            let moments = moments.map(move |&(name, place, per_parameter)| {
                let mut shape = shape.clone();
                shape.iter_mut().last().into_iter().for_each(|inner| *inner *= per_parameter);
                Array { name, shape, rendered: false, place, start: InitialValue::Zeros, sized_by }
            });
            [own].into_iter().chain(moments).filter(|array| array.count() > 0)
        })
    }

    /// Bytes of all of them.
    #[must_use]
    pub fn state_bytes(&self) -> u64 {
        self.arrays().map(|array| 4 * array.count() as u64).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Bounds;
    use crate::config::Config;
    use crate::field::{Capabilities, SceneFeatures};
    use glam::DVec3;

    #[test]
    fn arrays_follow_the_table() {
        let mut config = Config::default();
        config.grid.finest = 64;
        config.occupancy.cells = 16;
        let bounds =
            Bounds { center: DVec3::ZERO, half: 1.0, cascades: 2, source: String::new(), is_guess: false };
        let plan = Plan::suited_to(Capabilities::GPU, config, SceneFeatures::default(), (&bounds).into());
        let (entries, quads) = (plan.layout.entries, plan.layout.quads);
        let arrays: Vec<_> =
            plan.arrays().map(|array| (array.name, array.shape.clone(), array.rendered)).collect();
        let expected = [
            ("table", vec![entries, 2], true),
            ("table_moments", vec![entries, 4], false),
            ("mlp", vec![quads, 4], true),
            ("mlp_first", vec![quads, 4], false),
            ("mlp_second", vec![quads, 4], false),
            ("occupancy", vec![2, 16, 16, 16], false),
            ("occupancy_bits", vec![256], true),
        ];
        assert_eq!(arrays, expected);
        let mut hidden = vec![false; plan.cell_count()];
        hidden[33] = true;
        for array in plan.arrays() {
            let start = array.start(&plan, &hidden);
            assert_eq!(start.count(), array.count(), "{}", array.name);
            assert_eq!(array.has_words(), matches!(start, Numbers::Words(_)));
            assert_eq!(array.spec(&plan).bytes(), 4 * array.count() as u64);
        }
        assert_eq!(occupancy(&plan, &hidden).floats()[33], -1.0);
        assert_eq!(occupancy_bits(&plan, &hidden), Numbers::Words([&[!0, !2][..], &vec![!0; 254]].concat()));
    }
}
