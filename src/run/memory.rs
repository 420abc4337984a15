//! What training takes of the host's memory and of the device's, estimated before a photo is loaded.

mod host;

use crate::camera::Camera;
use crate::field::Plan;
use crate::field::renderer::Renderer;
use crate::gpu::Gpu;
use crate::gpu::buffer_spec::BufferSpec;
use crate::gpu::paged_array::{PageCapacity, STAGED_BYTES};
use crate::support::format::bytes;
use crate::support::remedy::{Advised, Remedy};
use anyhow::Result;
pub use host::{available_bytes, peak_bytes};
use serde::Serialize;
use std::fmt;

/// Bytes of the program itself, its driver and the kernels that it compiles: the peak of a small run on llvmpipe is 110 to
/// 175 MiB above its buffers, half of it pages of shared libraries. A GPU's driver is taken to need as much.
const BASE_BYTES: u64 = 128 << 20;

/// Bytes per pixel of a test view while it is compared: the rendering with its depth (20), both pictures (24), one of them
/// without what masks ignore (12), the moments of a channel (40), and the photo.
const COMPARING_BYTES: u64 = 100;

/// What decoding a photo usually takes of the most that it can take: few photos are progressive JPEGs or TIFFs.
const USUAL_SHARE: f64 = 2.0 / 3.0;

/// Bytes at the peak of a training run, the measuring of its test views included.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct MemoryUse {
    /// On the host, besides what the device holds.
    pub host_bytes: u64,
    /// On the device; of a CPU adapter, this is memory of the host too.
    pub device_bytes: u64,
    /// The photos' part of the device's.
    pub photo_bytes: u64,
}

/// Less memory than a training takes, by its estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shortage {
    /// Bytes that it takes of the host.
    pub needed: u64,
    /// Bytes that the host has left.
    pub available: u64,
}

/// Photos as the host sees them pass.
#[derive(Clone, Copy, Debug)]
pub struct PhotoUse<'a> {
    /// What took them.
    pub cameras: &'a [Camera],
    /// Most bytes that reading them takes at a time.
    pub stream_bytes: u64,
}

impl PhotoUse<'_> {
    /// Of each.
    fn pixels(&self) -> impl Iterator<Item = usize> {
        self.cameras.iter().map(|camera| camera.width as usize * camera.height as usize)
    }

    fn usual_stream_bytes(&self) -> u64 {
        (USUAL_SHARE * self.stream_bytes as f64) as u64
    }
}

impl MemoryUse {
    /// What training `plan` takes on the photos `trained`, where the views `tested` are measured at its end. Of a CPU
    /// adapter (`is_cpu`), what the device holds is memory of the host too.
    #[must_use]
    pub fn of_training(plan: &Plan, trained: PhotoUse<'_>, tested: PhotoUse<'_>, is_cpu: bool) -> Self {
        let photo_bytes = plan.photo_bytes(trained.pixels());
        let buffers = plan.training_buffers(plan.cell_count());
        let fixed: u64 = buffers.iter().map(BufferSpec::bytes).sum();
        let views = if tested.cameras.is_empty() { 0 } else { Renderer::bytes_besides(plan) };
        let device_bytes = fixed + photo_bytes + views;
        // One after the other: photos go to the device, which holds nothing else yet; parameters are drawn on the host or
        // read back for checkpoints; test views are compared with their photos.
        let loading = trained.usual_stream_bytes() + photo_bytes.min(STAGED_BYTES);
        let parameters = 2 * plan.state_bytes();
        let largest = tested.pixels().max().unwrap_or(0) as u64;
        let comparing = tested.usual_stream_bytes() + COMPARING_BYTES * largest;
        let loading = if is_cpu { (loading + photo_bytes).saturating_sub(device_bytes) } else { loading };
        let host_bytes = BASE_BYTES + loading.max(parameters).max(comparing);
        Self { host_bytes, device_bytes, photo_bytes }
    }

    /// Whether the adapter runs the plan and binds so many photos.
    ///
    /// # Errors
    /// When it does not: says how much there is, and what to do.
    pub fn check_device(&self, gpu: &Gpu, plan: &Plan) -> Result<()> {
        plan.check(gpu)?;
        let capacity = PageCapacity::of(&gpu.device.limits(), plan.memory).bytes();
        if self.photo_bytes > capacity {
            let found = format!(
                "the photos take {} on the device, and the adapter '{}' binds {} of them at most; ",
                bytes(self.photo_bytes),
                gpu.info.name,
                bytes(capacity),
            );
            return Err(Advised::new(found, fitting(self.photo_bytes, capacity), "").into());
        }
        Ok(())
    }

    /// Whether the host has the memory, that of the device included where `is_cpu`.
    ///
    /// # Errors
    /// When it seems not to: how much there is. It is an estimate, so that a run may begin all the same.
    pub fn check_host(&self, is_cpu: bool) -> Result<(), Shortage> {
        let needed = self.host_bytes + if is_cpu { self.device_bytes } else { 0 };
        match available_bytes() {
            Some(available) if available < needed => Err(Shortage { needed, available }),
            _ => Ok(()),
        }
    }

    /// The refusal of a run for want of memory on the host.
    #[must_use]
    pub fn refusal(&self, shortage: Shortage) -> anyhow::Error {
        let others = shortage.needed - self.photo_bytes;
        let less = fitting(self.photo_bytes, shortage.available.saturating_sub(others));
        Advised::new(format!("{shortage}; "), Remedy::OrOvercommit(Box::new(less)), "").into()
    }
}

impl fmt::Display for Shortage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "training takes about {} of memory, and this machine has {} left",
            bytes(self.needed),
            bytes(self.available)
        )
    }
}

/// How photos fit that take more than there is for them; something else to make smaller where nothing would be left of
/// them.
fn fitting(needed: u64, available: u64) -> Remedy {
    let ratio = needed as f64 / available.max(1) as f64;
    let downscale = ratio.sqrt().ceil();
    if available == 0 || downscale > 64.0 {
        return Remedy::SmallerField;
    }
    Remedy::FittingPixels { downscale: downscale as u32, percent: (100.0 / ratio).floor().max(1.0) as u32 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_advised_fits() {
        let parts = |needed, available| match fitting(needed, available) {
            Remedy::FittingPixels { downscale, percent } => Some((downscale, percent)),
            _ => None,
        };
        assert_eq!(parts(100, 99), Some((2, 99)));
        assert_eq!(parts(900, 100), Some((3, 11)));
        assert_eq!(parts(900, 0), None);
        let memory = MemoryUse { host_bytes: 500, device_bytes: 300, photo_bytes: 100 };
        let refusal = memory.refusal(Shortage { needed: 800, available: 100 }).to_string();
        assert!(refusal.contains("another machine, or begin all the same"), "{refusal}");
        let refusal = memory.refusal(Shortage { needed: 800, available: 750 }).to_string();
        assert!(refusal.contains("height by 2") && refusal.contains("leave 50 % of"), "{refusal}");
    }
}
