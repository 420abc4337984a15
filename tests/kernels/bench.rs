//! The adapter under test, and how its checks must end.

use std::sync::Arc;

use anyhow::{Context, Result};
use nerf::config::Accumulation;
use nerf::field::layer::Product;
use nerf::gpu::tensor::TensorMemory;
use nerf::gpu::{Gpu, adapter};
use nerf::verify::check::{Forced, Setup, Subject, Tally, Workbench};

/// The adapter under test with these variants.
pub(crate) fn subject_with(forced: Forced) -> Result<Subject> {
    let choice = std::env::var("NERF_ADAPTER").ok();
    let needed = "these tests need a Vulkan, Metal or DX12 adapter; a software driver will do";
    let adapter = adapter::choose(choice.as_deref()).context(needed)?;
    Subject::new(&Arc::new(Gpu::open(&adapter)?), forced)
}

/// The adapter under test with no more than WebGPU guarantees, and what a modest GPU takes.
pub(crate) fn modest_subject() -> Result<Subject> {
    let choice = std::env::var("NERF_ADAPTER").ok();
    let limits = wgpu::Limits::default();
    let gpu = Gpu::open_with(&adapter::choose(choice.as_deref())?, wgpu::Features::empty(), limits)?;
    let forced = Forced {
        accumulation: Some(Accumulation::Exchange),
        memory: Some(TensorMemory::Buffers),
        product: Some(Product { rows: 2, shared_weights: false }),
    };
    Subject::new(&Arc::new(gpu), forced)
}

/// The adapter under test with what its plan chooses.
pub(crate) fn subject() -> Result<Subject> {
    subject_with(Forced::default())
}

/// A workbench of `setup` on the adapter under test.
pub(crate) fn workbench(setup: Setup) -> Result<Workbench> {
    subject()?.workbench(setup)
}

/// Prints what was found, and fails where a bound is broken.
#[track_caller]
pub(crate) fn passes(tallies: impl IntoIterator<Item = Tally>) {
    let tallies: Vec<_> = tallies.into_iter().collect();
    for Tally { name, cases, worst, bound, case, .. } in &tallies {
        println!("{name}: {worst:.1e} of {bound:.1e} over {cases} cases; {case}");
    }
    let broken: Vec<_> = tallies.iter().filter(|tally| !tally.pass).collect();
    assert!(broken.is_empty(), "{broken:#?}");
}
