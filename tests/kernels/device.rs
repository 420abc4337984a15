//! What a device refuses.

use anyhow::Result;
use nerf::gpu::Gpu;
use nerf::gpu::kernel::Kernel;
use nerf::gpu::pass::Stage;
use nerf::gpu::source::Source;

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
