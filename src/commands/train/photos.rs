//! The training photos on their way from files to the device.

use super::setup::Setup;
use crate::progress::Progress;
use crate::remarks::Remarks;
use anyhow::Result;
use nerf::capture::dataset::Dataset;
use nerf::field::views::Views;
use nerf::gpu::Gpu;
use nerf::run::memory::Memory;
use nerf::support::format::{bytes, few};
use std::sync::Arc;

/// Whether there is room for the training and its photos, on the host and on the device.
pub(in crate::commands) fn check_memory(
    setup: &Setup,
    dataset: &Dataset,
    gpu: &Gpu,
    remarks: Remarks,
) -> Result<()> {
    let memory = Memory::of_training(&setup.plan, &setup.cameras, dataset.stream_bytes(&setup.train));
    let [host, device, photos] = [memory.host_bytes, memory.device_bytes, memory.photo_bytes].map(bytes);
    remarks.say(&format!("memory: {host} on the host, {device} on the device, {photos} of it photos"));
    memory.check(gpu, &setup.plan)
}

/// Decodes the training photos, a few at a time, and puts them on the device.
pub(in crate::commands) fn load(
    setup: &Setup,
    dataset: &Dataset,
    gpu: &Arc<Gpu>,
    remarks: Remarks,
) -> Result<Views> {
    let mut views = Views::new(gpu, &setup.plan, &setup.cameras)?;
    let progress = Progress::new(remarks, "loading");
    let mut ignored = Vec::new();
    dataset.stream(&setup.train, setup.plan.needs.depth, &mut |position, photo| {
        if photo.is_ignored() {
            ignored.push(dataset.frames[setup.train[position]].name.as_str());
        }
        views.add(&photo)?;
        progress.count(position + 1, setup.train.len(), "images");
        Ok(())
    })?;
    if !ignored.is_empty() {
        progress.say(&format!(
            "warning: masks ignore every pixel of {} of {} training photos, which add nothing: {}",
            ignored.len(),
            setup.train.len(),
            few(&ignored)
        ));
    }
    Ok(views)
}
