//! What a dataset needs of a training, and what it does not.

use nerf::camera::Lens;
use nerf::config::Background;
use nerf::dataset::Dataset;
use nerf::kernels::Needs;

/// What training on a dataset, and measuring its test views, needs.
pub(super) fn of(dataset: &Dataset) -> Needs {
    let mut used = dataset.train.iter().chain(&dataset.test);
    Needs {
        lens: used.any(|&index| dataset.frames[index].camera.lens != Lens::Pinhole),
        alpha: dataset.train.iter().any(|&index| dataset.frames[index].has_alpha),
        hdr: dataset.is_hdr,
        cascades: dataset.bounds.cascades,
        cameras: dataset.train.len(),
        ..Needs::default()
    }
}

/// The parts that a scene with these needs does without.
pub(super) fn left_out(needs: &Needs, background: Background, dataset: &Dataset) -> Vec<&'static str> {
    let parts = [
        (!needs.lens, "lens model (all cameras are pinholes)"),
        (needs.cascades == 1, "cascades and growing steps (the scene is bounded)"),
        (!needs.alpha && !needs.hdr, "alpha (the images are opaque)"),
        (!needs.hdr, "linear pixels (the images have 8 bits)"),
        (background != Background::Random, "random backgrounds (not asked for)"),
        (dataset.is_hdr, "8-bit pixels (the images are linear)"),
    ];
    parts.into_iter().filter(|(is_left_out, _)| *is_left_out).map(|(_, part)| part).collect()
}
