//! Checks of the kernels on an adapter against the f64 reference.
//!
//! [`run`] does what `nerf check` does: every kernel, at ordinary, stiff and extreme inputs and odd sizes. Each check
//! is a function of its own that returns [`Tally`]s, which the tests call too.
//!
//! A [`Subject`] is the adapter with the variants to check. A [`Workbench`] is a small plan with all its buffers, and
//! knows what they look like: it puts batches on the device, runs stages and reads what they left. [`Setup`] says
//! what it is built from, [`draw`] and [`hard_rays`] make its inputs.

pub mod activation;
pub mod adam;
pub mod draw;
pub mod exponential;
pub mod fused;
pub mod grid;
pub mod hard_rays;
pub mod harmonics;
pub mod lens;
pub mod loss;
pub mod marching;
pub mod networks;
pub mod occupancy;
mod parameters;
mod probe;
pub mod random;
pub mod rays;
pub mod selection;
mod setup;
pub mod step;
mod subject;
mod tally;
pub mod thinned;
pub mod view;
mod workbench;

pub use setup::Setup;
pub use subject::{Forced, Subject};
pub use tally::Tally;
pub use workbench::{Kept, Outcome, Workbench, visible_cells};

use anyhow::{Context, Result};

/// A check: what it is of, and what runs it.
struct Check {
    name: &'static str,
    run: fn(&Subject) -> Result<Vec<Tally>>,
}

/// In the order of a training step.
const CHECKS: [Check; 17] = [
    Check { name: "exponentials", run: |subject| Ok(vec![exponential::exponentials(subject)?]) },
    Check { name: "random numbers", run: |subject| Ok(vec![random::random_numbers(subject)?]) },
    Check { name: "lenses", run: lens::lens_models },
    Check { name: "rays of views", run: rays::view_rays },
    Check { name: "rays of large views", run: rays::sharp_rays },
    Check { name: "rays of a training", run: |subject| Ok(vec![rays::training_rays(subject)?]) },
    Check { name: "marching", run: marching::marched_samples },
    Check { name: "hash grid", run: |subject| Ok(vec![grid::features(subject)?]) },
    Check { name: "selection", run: |subject| Ok(vec![selection::selected_samples(subject)?]) },
    Check { name: "harmonics", run: |subject| Ok(vec![harmonics::harmonics(subject)?]) },
    Check { name: "activations", run: |subject| Ok(vec![activation::activations(subject)?]) },
    Check { name: "networks and scatter", run: |subject| networks::networks(subject, &networks::SHAPES) },
    Check { name: "render, loss and gradient", run: compositing },
    Check { name: "further terms of the loss", run: loss::further_terms },
    Check { name: "Adam", run: adam::adam },
    Check { name: "occupancy", run: |subject| Ok(vec![occupancy::occupancy_update(subject)?]) },
    Check { name: "whole steps and views", run: whole },
];

fn compositing(subject: &Subject) -> Result<Vec<Tally>> {
    Ok([fused::fused(subject)?, vec![thinned::thinned_rays(subject)?]].concat())
}

fn whole(subject: &Subject) -> Result<Vec<Tally>> {
    let setups = step::setups();
    let step = step::one_step(subject, &setups[2..])?;
    Ok([vec![step], view::rendered_views(subject)?].concat())
}

/// Runs every check; `progress` is told how many are done, how many there are, and which one is next.
///
/// # Errors
/// When the device was lost or refuses a kernel; the message names the check.
pub fn run(subject: &Subject, progress: &dyn Fn(usize, usize, &str)) -> Result<Vec<Tally>> {
    let mut tallies = Vec::new();
    for (done, check) in CHECKS.iter().enumerate() {
        progress(done, CHECKS.len(), check.name);
        tallies.extend((check.run)(subject).with_context(|| format!("checking {}", check.name))?);
    }
    Ok(tallies)
}
