//! What training takes of the host's memory and of the device's, estimated before a photo is loaded.

use crate::camera::Camera;
use crate::field::Plan;
use crate::field::renderer::Renderer;
use crate::gpu::Gpu;
use crate::gpu::buffer_spec::BufferSpec;
use crate::gpu::paged_array::PageCapacity;
use crate::support::format::bytes;
use crate::support::remedy::{Advised, Remedy};
use anyhow::{Result, anyhow};
use serde::Serialize;
use sysinfo::{MemoryRefreshKind, RefreshKind, System};

/// Bytes of the program itself, its driver and the kernels that it compiles.
const BASE_BYTES: u64 = 640 << 20;

/// Bytes at the peak of a training run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct MemoryUse {
    /// On the host, without what the device holds.
    pub host_bytes: u64,
    /// On the device; of a CPU adapter, this is memory of the host too.
    pub device_bytes: u64,
    /// The photos' part of the device's.
    pub photo_bytes: u64,
}

impl MemoryUse {
    /// What training `plan` takes with the photos that `cameras` took; loading them takes `stream_bytes`.
    #[must_use]
    pub fn of_training(plan: &Plan, cameras: &[Camera], stream_bytes: u64) -> Self {
        let pixels = cameras.iter().map(|camera| camera.width as usize * camera.height as usize);
        let photo_bytes = plan.photo_bytes(pixels);
        let buffers = plan.training_buffers(plan.cell_count());
        let fixed: u64 = buffers.iter().map(BufferSpec::bytes).sum();
        // Parameters are drawn on the host first, and read back for checkpoints.
        let parameters = plan.state_bytes();
        Self {
            host_bytes: BASE_BYTES + stream_bytes + 2 * parameters,
            device_bytes: fixed + photo_bytes + Renderer::bytes(plan),
            photo_bytes,
        }
    }

    /// Whether the adapter runs the plan and binds so many photos, and the host has the memory.
    ///
    /// # Errors
    /// When it does not: says how much there is, and what to do.
    pub fn check(&self, gpu: &Gpu, plan: &Plan) -> Result<()> {
        plan.check(gpu)?;
        let capacity = PageCapacity::of(&gpu.device.limits(), plan.memory).bytes();
        if self.photo_bytes > capacity {
            let found = format!(
                "the photos take {} on the device, and the adapter '{}' binds {} of them at most; ",
                bytes(self.photo_bytes),
                gpu.info.name,
                bytes(capacity),
            );
            return Err(advised(found, self.photo_bytes, capacity));
        }
        let on_host = self.host_bytes + if gpu.is_cpu() { self.device_bytes } else { 0 };
        if let Some(available) = available_bytes().filter(|&available| available < on_host) {
            let others = on_host - self.photo_bytes;
            let found = format!(
                "training takes {} of memory, and this machine has {} left; ",
                bytes(on_host),
                bytes(available),
            );
            return Err(advised(found, self.photo_bytes, available.saturating_sub(others)));
        }
        Ok(())
    }
}

/// What was found, and what to do where the photos take more than there is for them.
fn advised(found: String, needed: u64, available: u64) -> anyhow::Error {
    match fitting(needed, available) {
        Some(remedy) => Advised::new(found, remedy, "").into(),
        None => anyhow!("{found}use a smaller table or batch (see configs/cpu.json), or another machine"),
    }
}

/// How photos fit that take more than there is for them; `None` where nothing would be left of them.
fn fitting(needed: u64, available: u64) -> Option<Remedy> {
    let ratio = needed as f64 / available.max(1) as f64;
    let downscale = ratio.sqrt().ceil();
    (available > 0 && downscale <= 64.0).then(|| Remedy::FittingPixels {
        downscale: downscale as u32,
        percent: (100.0 / ratio).floor().max(1.0) as u32,
    })
}

/// Memory that the host can still give, within the limits of its container; `None` where the system does not say.
#[must_use]
pub fn available_bytes() -> Option<u64> {
    let memory = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
    let system = System::new_with_specifics(memory);
    // Without /proc nothing is known, and sysinfo panics when asked for the container's limits.
    if system.total_memory() == 0 {
        return None;
    }
    let free = system.available_memory();
    let limited = system.cgroup_limits().map_or(free, |limits| limits.free_memory.min(free));
    (limited > 0).then_some(limited)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_machine_has_memory() {
        assert!(available_bytes().is_none_or(|bytes| bytes > 1 << 20));
    }

    #[test]
    fn what_is_advised_fits() {
        let parts = |needed, available| match fitting(needed, available) {
            Some(Remedy::FittingPixels { downscale, percent }) => Some((downscale, percent)),
            _ => None,
        };
        assert_eq!(parts(100, 99), Some((2, 99)));
        assert_eq!(parts(900, 100), Some((3, 11)));
        assert_eq!(parts(900, 0), None);
        assert!(advised(String::new(), 900, 0).to_string().contains("another machine"));
    }
}
