//! Where a training run stands.

use super::parameters::Numbers;

/// Everything that a training run needs to go on as if it had never stopped.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Steps taken.
    pub step: u32,
    /// Rays of the next step.
    pub rays: u32,
    /// By how much its steps along the rays are longer than the configuration's, as a share of them.
    pub step_excess: f32,
    /// The numbers of the plan's [arrays](super::Plan::arrays), in that order.
    pub arrays: Vec<(&'static str, Numbers)>,
}

impl State {
    /// The numbers of an array of floats; none where there is no such array.
    #[must_use]
    pub fn floats(&self, name: &str) -> &[f32] {
        self.arrays.iter().find(|(own, _)| *own == name).map_or(&[], |(_, numbers)| numbers.floats())
    }

    /// The same, to be changed.
    pub fn floats_mut(&mut self, name: &str) -> &mut [f32] {
        match self.arrays.iter_mut().find(|(own, _)| *own == name) {
            Some((_, Numbers::Floats(numbers))) => numbers,
            _ => &mut [],
        }
    }
}
