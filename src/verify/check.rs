//! Checks of the kernels on an adapter against the f64 reference.
//!
//! [`run`] does what `nerf check` does: every kernel, at ordinary, stiff and extreme inputs and odd sizes. Each check
//! is a function of its own that returns [`CheckResult`]s, which the tests call too.
//!
//! A [`CheckedAdapter`] is the adapter with the variants to check. A [`Workbench`] is a small plan with all its buffers, and
//! knows what they look like: it puts batches on the device, runs stages and reads what they left. [`Setup`] says
//! what it is built from, [`inputs`] and [`stress_rays`] make its inputs.

pub mod activation;
pub mod adam;
mod check_result;
mod checked_adapter;
mod device_parameters;
pub mod exponential;
pub mod fused;
pub mod grid;
pub mod harmonics;
pub mod inputs;
pub mod lens;
pub mod loss;
pub mod marching;
pub mod networks;
pub mod occupancy;
mod probe;
pub mod random;
pub mod rays;
pub mod rendered_view;
pub mod selection;
mod setup;
pub mod step;
pub mod stress_rays;
pub mod thinned;
mod workbench;

pub use check_result::CheckResult;
pub use checked_adapter::{CheckedAdapter, Forced};
pub use setup::Setup;
pub use workbench::{KeptSample, PassOutput, Workbench, visible_cells};

use anyhow::{Context, Result};

/// A check: what it is of, and what runs it.
struct KernelCheck {
    name: &'static str,
    run: fn(&CheckedAdapter) -> Result<Vec<CheckResult>>,
}

/// In the order of a training step.
const CHECKS: [KernelCheck; 17] = [
    KernelCheck { name: "exponentials", run: |adapter| Ok(vec![exponential::exponentials(adapter)?]) },
    KernelCheck { name: "random numbers", run: |adapter| Ok(vec![random::random_numbers(adapter)?]) },
    KernelCheck { name: "lenses", run: lens::lens_models },
    KernelCheck { name: "rays of views", run: rays::view_rays },
    KernelCheck { name: "rays of large views", run: rays::sharp_rays },
    KernelCheck { name: "training rays", run: |adapter| Ok(vec![rays::training_rays(adapter)?]) },
    KernelCheck { name: "marching", run: marching::marched_samples },
    KernelCheck { name: "hash grid", run: |adapter| Ok(vec![grid::features(adapter)?]) },
    KernelCheck { name: "selection", run: |adapter| Ok(vec![selection::selected_samples(adapter)?]) },
    KernelCheck { name: "harmonics", run: |adapter| Ok(vec![harmonics::harmonics(adapter)?]) },
    KernelCheck { name: "activations", run: |adapter| Ok(vec![activation::activations(adapter)?]) },
    KernelCheck {
        name: "networks and scatter",
        run: |adapter| networks::networks(adapter, &networks::SHAPES),
    },
    KernelCheck { name: "render, loss and gradient", run: compositing },
    KernelCheck { name: "further terms of the loss", run: loss::further_terms },
    KernelCheck { name: "Adam", run: adam::adam },
    KernelCheck { name: "occupancy", run: |adapter| Ok(vec![occupancy::occupancy_update(adapter)?]) },
    KernelCheck { name: "whole steps and views", run: whole },
];

fn compositing(adapter: &CheckedAdapter) -> Result<Vec<CheckResult>> {
    Ok([fused::fused(adapter)?, vec![thinned::thinned_rays(adapter)?]].concat())
}

fn whole(adapter: &CheckedAdapter) -> Result<Vec<CheckResult>> {
    let setups = step::setups();
    let step = step::one_step(adapter, &setups[2..])?;
    Ok([vec![step], rendered_view::rendered_views(adapter)?].concat())
}

/// Runs every check; `progress` gets how many are done, how many there are, and which one is next.
///
/// # Errors
/// When the device was lost or refuses a kernel; the message names the check.
pub fn run(adapter: &CheckedAdapter, progress: &dyn Fn(usize, usize, &str)) -> Result<Vec<CheckResult>> {
    let mut results = Vec::new();
    for (done, check) in CHECKS.iter().enumerate() {
        progress(done, CHECKS.len(), check.name);
        results.extend((check.run)(adapter).with_context(|| format!("checking {}", check.name))?);
    }
    Ok(results)
}
