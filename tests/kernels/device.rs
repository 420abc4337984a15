//! What a device refuses.

use anyhow::{Context, Result};
use nerf::gpu::Gpu;
use nerf::gpu::kernel::Kernel;
use nerf::gpu::pass::Stage;
use nerf::gpu::source::Source;
use nerf::support::transient::is_transient;

fn gpu() -> Result<Gpu> {
    Gpu::choose(std::env::var("NERF_ADAPTER").ok().as_deref())
}

/// A kernel that doubles `numbers`, in workgroups of so many threads.
fn doubling(gpu: &Gpu, label: &str, threads: usize) -> Result<Kernel> {
    let text = "var<storage, read_write> numbers: array<u32>;\n\
                @compute @workgroup_size(THREADS)\n\
                fn main(@builtin(global_invocation_id) id: vec3<u32>) { numbers[id.x] *= 2u; }\n";
    Kernel::new(gpu, &Source::new(label).count("THREADS", threads).part("double", text), &[])
}

/// Kernels are compiled side by side; that one is refused is told where it runs, by its name, whatever else there is.
#[test]
fn refused_kernels_are_named() -> Result<()> {
    let gpu = gpu()?;
    let numbers = gpu.storage_with("numbers", &[1u32, 2, 3, 4])?;
    let stage = |label: &str, threads| -> Result<Stage> {
        let bound = doubling(&gpu, label, threads)?.bind(&gpu, &[numbers.resource()])?;
        Ok(Stage::single(bound))
    };
    let most = gpu.device.limits().max_compute_invocations_per_workgroup as usize;
    let stages: Vec<_> = (0..8).map(|index| stage(&format!("double {index}"), 4)).collect::<Result<_>>()?;
    let wide = [stage("too wide", most + 1)?, stage("wider", most + 2)?];
    for _ in 0..2 {
        let refusal = gpu.run("twice", stages.iter().chain(&wide), None).expect_err("it is too wide");
        assert!(format!("{refusal:#}").starts_with("creating the kernel 'too wide' on '"), "{refusal:#}");
    }
    gpu.run("eight times", &stages, None)?;
    assert_eq!(gpu.read::<u32>(&numbers, 0, 4)?, [256, 512, 768, 1024]);
    Ok(())
}

/// Nothing is compiled for a device that is to stop.
#[test]
fn an_interrupt_is_heard_between_kernels() -> Result<()> {
    let gpu = gpu()?;
    let numbers = gpu.storage_with("numbers", &[1u32; 4])?;
    gpu.interrupt.raise();
    let refusal = doubling(&gpu, "double", 4).expect_err("it is to stop");
    assert!(nerf::support::interrupt::Interrupted::is_cause_of(&refusal), "{refusal:#}");
    assert_eq!(gpu.read::<u32>(&numbers, 0, 4)?, [1; 4]);
    Ok(())
}

/// An adapter of which nothing is left to allocate, if its driver tells how much is (lavapipe's old ones do not).
#[test]
fn a_full_memory_is_told_with_what_to_do() -> Result<()> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.memory_budget_thresholds.for_resource_creation = Some(0);
    let instance = wgpu::Instance::new(descriptor);
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::VULKAN));
    let Some(adapter) = adapters.first() else { return Ok(()) };
    let gpu = Gpu::open(adapter)?;
    let Err(failure) = gpu.storage::<u32>("numbers", 1 << 20) else { return Ok(()) };
    let expected = format!(
        "the memory of the adapter '{}' is full; try again, a training from its last checkpoint; should it happen again, \
         close what else uses the adapter, ask less of it (fewer or smaller photos, a smaller batch or table), or choose \
         another one: there is no room for the 4.0 MiB of 'numbers'",
        gpu.info.name
    );
    assert_eq!(format!("{failure:#}"), expected);
    assert!(is_transient(&failure));
    // The device is as it was.
    gpu.check().context("it was told already")
}
