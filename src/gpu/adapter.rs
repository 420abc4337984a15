//! Listing the adapters and choosing one.

use crate::support::remedy::{Advised, Remedy};
use anyhow::{Result, bail};
use serde::Serialize;

/// What `nerf adapters` prints about one adapter.
#[derive(Clone, Debug, Serialize)]
pub struct AdapterEntry {
    /// The index that [`choose`] takes.
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
    /// Which of f32 atomics, 64-bit integer atomics, half floats, subgroups, cooperative matrices and timestamps are
    /// there.
    pub features: Vec<&'static str>,
    /// Fewest and most threads of a subgroup.
    pub subgroup_sizes: [u32; 2],
    /// The matrix products that it has units for.
    pub cooperative_matrices: Vec<MatrixSize>,
    /// All that wgpu says of its limits.
    pub limits: wgpu::Limits,
}

/// A product of matrices `[m, k]` and `[k, n]` that is added to one of `[m, n]`.
#[derive(Clone, Debug, Serialize)]
pub struct MatrixSize {
    /// Rows of the result.
    pub m: u32,
    /// Columns of the result.
    pub n: u32,
    /// Terms of a sum.
    pub k: u32,
    /// Type of the factors.
    pub factors: wgpu::CooperativeScalarType,
    /// Type of the sums.
    pub sums: wgpu::CooperativeScalarType,
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
pub fn list(adapters: &[wgpu::Adapter]) -> Vec<AdapterEntry> {
    adapters.iter().enumerate().map(|(index, adapter)| describe(index, adapter)).collect()
}

fn describe(index: usize, adapter: &wgpu::Adapter) -> AdapterEntry {
    let info = adapter.get_info();
    let features = [
        ("float32-atomics", wgpu::Features::SHADER_FLOAT32_ATOMIC),
        ("int64-atomics", wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS),
        ("half-floats", wgpu::Features::SHADER_F16),
        ("subgroups", wgpu::Features::SUBGROUP),
        ("cooperative-matrices", wgpu::Features::EXPERIMENTAL_COOPERATIVE_MATRIX),
        ("timestamps", wgpu::Features::TIMESTAMP_QUERY),
    ];
    let matrices = adapter.cooperative_matrix_properties().into_iter().map(|size| MatrixSize {
        m: size.m_size,
        n: size.n_size,
        k: size.k_size,
        factors: size.ab_type,
        sums: size.cr_type,
    });
    AdapterEntry {
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
        subgroup_sizes: [info.subgroup_min_size, info.subgroup_max_size],
        cooperative_matrices: matrices.collect(),
        limits: adapter.limits(),
        name: info.name,
    }
}

/// Picks the adapter that `choice` names: an index, or words that are parts of its name or its backend's; without one,
/// the first.
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
    let names: Vec<_> = list(&adapters).iter().map(|a| format!("{} over {}", a.name, a.backend)).collect();
    let position = match choice.parse::<usize>() {
        Ok(index) => (index < adapters.len()).then_some(index),
        Err(_) => names.iter().position(|name| is_named(name, choice)),
    };
    match position {
        Some(index) => Ok(adapters.swap_remove(index)),
        None => {
            let names: Vec<_> =
                names.iter().enumerate().map(|(index, name)| format!("{index}: {name}")).collect();
            let names = names.join("; ");
            let expected = format!(
                " expects an index, or parts of a name and backend; found '{choice}', and there are: {names}"
            );
            bail!(Advised::new("", Remedy::Adapter, expected))
        }
    }
}

/// Whether all words of `choice` occur in an adapter's name, in any order and case.
fn is_named(name: &str, choice: &str) -> bool {
    let name = name.to_lowercase();
    let mut words = choice.split_whitespace().peekable();
    words.peek().is_some() && words.all(|word| name.contains(&word.to_lowercase()))
}

#[cfg(test)]
mod tests {
    use super::is_named;

    #[test]
    fn words_name_adapter_and_backend() {
        let name = "NVIDIA GeForce RTX 3090 over Dx12";
        for choice in ["nvidia", "dx12", "rtx 3090", "dx12 geforce", "DX12"] {
            assert!(is_named(name, choice), "{choice}");
        }
        for choice in ["", " ", "vulkan", "vulkan nvidia", "rtx 3080"] {
            assert!(!is_named(name, choice), "{choice}");
        }
    }
}
