//! What a plan depends on of an adapter.

use crate::config::Accumulation;
use crate::gpu::Gpu;
use crate::gpu::tensor::TensorMemory;
use anyhow::{Result, ensure};

/// What a plan depends on of an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capabilities {
    /// It runs on the CPU.
    pub is_cpu: bool,
    /// It adds floats atomically.
    pub float_atomics: bool,
    /// It adds 64-bit integers atomically.
    pub long_atomics: bool,
    /// It has subgroups of a multiple of 8 threads.
    pub subgroups_of_8: bool,
    /// Where its tensors are fast.
    pub memory: TensorMemory,
}

impl Capabilities {
    /// A usual GPU.
    pub const GPU: Self = Self {
        is_cpu: false,
        float_atomics: true,
        long_atomics: true,
        subgroups_of_8: true,
        memory: TensorMemory::Buffers,
    };

    /// Those of an adapter.
    #[must_use]
    pub fn of(gpu: &Gpu) -> Self {
        Self {
            is_cpu: gpu.is_cpu(),
            float_atomics: gpu.has(wgpu::Features::SHADER_FLOAT32_ATOMIC),
            long_atomics: gpu.has(crate::gpu::LONG_ATOMICS),
            subgroups_of_8: gpu.has_subgroups_of(8),
            memory: gpu.fast_memory(),
        }
    }

    /// Whether an adapter called `name` can sum gradients like this.
    ///
    /// # Errors
    /// When it cannot: says why, and what to take instead.
    pub fn check(&self, accumulation: Accumulation, name: &str) -> Result<()> {
        ensure!(
            accumulation != Accumulation::Ordered || self.is_cpu,
            "ordered accumulation adds all gradients of a grid level in one thread: on a GPU like '{name}' a step would \
             take seconds; leave it out, or ask for fixed, whose sum is the same in every run too"
        );
        ensure!(
            accumulation != Accumulation::Float || self.float_atomics,
            "float accumulation needs atomic addition of floats, and the adapter '{name}' does not have it; leave it \
             out, or ask for exchange or fixed"
        );
        ensure!(
            accumulation != Accumulation::Long || self.long_atomics,
            "long accumulation needs atomic addition of 64-bit integers, and the adapter '{name}' does not have it; \
             leave it out, or ask for fixed, whose sums are the same"
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adapters_refuse_sums_that_do_not_suit_them() {
        let modest = Capabilities { float_atomics: false, long_atomics: false, ..Capabilities::GPU };
        let software = Capabilities { is_cpu: true, ..modest };
        let refusal = |adapter: Capabilities, accumulation| {
            adapter.check(accumulation, "it").err().map(|error| error.to_string()).unwrap_or_default()
        };
        assert!(refusal(Capabilities::GPU, Accumulation::Ordered).contains("one thread"));
        assert!(refusal(modest, Accumulation::Float).contains("exchange or fixed"));
        assert!(refusal(modest, Accumulation::Long).contains("ask for fixed"));
        for accumulation in [Accumulation::Exchange, Accumulation::Fixed] {
            assert_eq!(refusal(modest, accumulation), "");
        }
        assert_eq!(
            refusal(Capabilities::GPU, Accumulation::Float) + &refusal(software, Accumulation::Ordered),
            ""
        );
    }
}
