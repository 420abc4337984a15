//! The adapter under test, and how its checks must end.

use std::sync::Arc;

use anyhow::{Context, Result};
use nerf::config::Accumulation;
use nerf::field::layer::Product;
use nerf::gpu::tensor::TensorMemory;
use nerf::gpu::{Gpu, adapter};
use nerf::verify::check::{CheckResult, CheckedAdapter, Forced, Setup, Workbench};

/// The adapter under test with these variants.
pub(crate) fn adapter_with(forced: Forced) -> Result<CheckedAdapter> {
    let choice = std::env::var("NERF_ADAPTER").ok();
    let needed = "these tests need a Vulkan, Metal or DX12 adapter; a software driver will do";
    let adapter = adapter::choose(choice.as_deref()).context(needed)?;
    CheckedAdapter::new(&Arc::new(Gpu::open(&adapter)?), forced)
}

/// The adapter under test with no more than WebGPU guarantees, and what a modest GPU takes.
pub(crate) fn modest_adapter() -> Result<CheckedAdapter> {
    let choice = std::env::var("NERF_ADAPTER").ok();
    let limits = wgpu::Limits::default();
    let gpu = Gpu::open_with(&adapter::choose(choice.as_deref())?, wgpu::Features::empty(), limits)?;
    let forced = Forced {
        accumulation: Some(Accumulation::Exchange),
        memory: Some(TensorMemory::Buffers),
        product: Some(Product::Tiled),
    };
    CheckedAdapter::new(&Arc::new(gpu), forced)
}

/// The adapter under test with what its plan chooses.
pub(crate) fn adapter() -> Result<CheckedAdapter> {
    adapter_with(Forced::default())
}

/// A workbench of `setup` on the adapter under test.
pub(crate) fn workbench(setup: Setup) -> Result<Workbench> {
    adapter()?.workbench(setup)
}

/// Prints what was found, and fails where a bound is broken.
#[track_caller]
pub(crate) fn passes(results: impl IntoIterator<Item = CheckResult>) {
    let results: Vec<_> = results.into_iter().collect();
    for CheckResult { name, cases, worst, bound, case, .. } in &results {
        println!("{name}: {worst:.1e} of {bound:.1e} over {cases} cases; {case}");
    }
    let broken: Vec<_> = results.iter().filter(|result| !result.pass).collect();
    assert!(broken.is_empty(), "{broken:#?}");
}
