//! What is wrong with a dataset as it was read.

use crate::flags::with_flags;
use nerf::capture::dataset::Dataset;
use nerf::capture::diagnostics::Diagnostic;
use nerf::run::Estimate;

/// Number of images that are there.
pub(super) fn found(dataset: &Dataset) -> usize {
    dataset.listed - dataset.missing.len()
}

/// What keeps training from beginning, and what the reader noted.
pub(super) fn of_dataset(dataset: &Dataset) -> Vec<Diagnostic> {
    let mut problems = Vec::new();
    problems.extend(dataset.damaged.iter().map(Diagnostic::error));
    if found(dataset) > 0 && dataset.train.is_empty() {
        problems.push(Diagnostic::error(
            "there is no frame to train on: every frame is in the test or validation split; name the folder or the \
             file that lists the training frames",
        ));
    }
    problems.extend(dataset.notes.iter().cloned());
    problems
}

/// What does not fit into the memory, and what the estimate assumes.
pub(super) fn of_memory(estimate: &Estimate) -> Vec<Diagnostic> {
    let assumed = "there is no adapter on this machine, which training needs: the memory is that of a GPU with the \
                   default settings; see `nerf adapters`";
    let excess = estimate.excess.iter().map(|error| Diagnostic::error(with_flags(error)));
    excess.chain(estimate.adapter.is_none().then(|| Diagnostic::note(assumed))).collect()
}
