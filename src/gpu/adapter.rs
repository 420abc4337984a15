//! Listing the adapters and choosing one.

use anyhow::{Result, bail};
use serde::Serialize;

/// What `nerf adapters` tells of one adapter.
#[derive(Clone, Debug, Serialize)]
pub struct Listing {
    /// The index that `--adapter` takes.
    pub index: usize,
    /// The adapter's name.
    pub name: String,
    /// `DiscreteGpu`, `IntegratedGpu`, `VirtualGpu`, `Cpu` or `Other`.
    pub kind: String,
    /// `Vulkan`, `Metal` or `Dx12`.
    pub backend: String,
    /// The driver's name and version.
    pub driver: String,
    /// The largest buffer binding, in bytes.
    pub max_binding_bytes: u64,
    /// Whether f32 atomics and timestamps are there.
    pub features: Vec<&'static str>,
}

/// All adapters of this machine, GPUs first, in a fixed order.
#[must_use]
pub fn enumerate() -> Vec<wgpu::Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    // Dispatch sizes are computed by our own kernels: the validation pass before every indirect dispatch
    // would double the number of dispatches.
    descriptor.flags.remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
    let instance = wgpu::Instance::new(descriptor);
    let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    });
    adapters
}

/// Describes `adapters` in their order.
#[must_use]
pub fn list(adapters: &[wgpu::Adapter]) -> Vec<Listing> {
    adapters.iter().enumerate().map(|(index, adapter)| describe(index, adapter)).collect()
}

fn describe(index: usize, adapter: &wgpu::Adapter) -> Listing {
    let info = adapter.get_info();
    let features = [
        ("float32-atomics", wgpu::Features::SHADER_FLOAT32_ATOMIC),
        ("timestamps", wgpu::Features::TIMESTAMP_QUERY),
    ];
    Listing {
        index,
        kind: format!("{:?}", info.device_type),
        backend: format!("{:?}", info.backend),
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        max_binding_bytes: adapter.limits().max_storage_buffer_binding_size,
        features: features
            .iter()
            .filter(|(_, feature)| adapter.features().contains(*feature))
            .map(|(name, _)| *name)
            .collect(),
        name: info.name,
    }
}

/// Picks the adapter that `choice` names: an index, or a part of the name; without one, the first.
///
/// # Errors
/// When there is no adapter, or none that fits; the message lists what there is.
pub fn choose(choice: Option<&str>) -> Result<wgpu::Adapter> {
    let mut adapters = enumerate();
    if adapters.is_empty() {
        bail!(
            "no Vulkan, Metal or DX12 adapter was found. On Debian or Ubuntu install a software driver with \
             `apt-get install libvulkan1 mesa-vulkan-drivers`; on other systems install the graphics \
             driver of your GPU"
        );
    }
    let Some(choice) = choice else { return Ok(adapters.swap_remove(0)) };
    let wanted = choice.to_lowercase();
    let position = match choice.parse::<usize>() {
        Ok(index) => (index < adapters.len()).then_some(index),
        Err(_) => adapters.iter().position(|a| a.get_info().name.to_lowercase().contains(&wanted)),
    };
    match position {
        Some(index) => Ok(adapters.swap_remove(index)),
        None => {
            let names: Vec<_> = list(&adapters).iter().map(|a| format!("{}: {}", a.index, a.name)).collect();
            bail!(
                "--adapter expects an index or a part of a name; found '{choice}', and there are: {}",
                names.join("; ")
            )
        }
    }
}
