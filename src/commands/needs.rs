//! What a dataset needs of a training, and what it does not.

use nerf::camera::LensKind;
use nerf::config::Background;
use nerf::dataset::Dataset;
use nerf::kernels::Needs;

/// What training on a dataset, and measuring its test views, needs; the brightness of its photos is not looked at.
pub(super) fn of(dataset: &Dataset) -> Needs {
    let used = dataset.train.iter().chain(&dataset.test);
    Needs {
        lenses: LensKind::among(used.map(|&index| &dataset.frames[index].camera)),
        alpha: dataset.train.iter().any(|&index| dataset.frames[index].has_alpha),
        hdr: dataset.is_hdr,
        cascades: dataset.bounds.cascades,
        cameras: dataset.train.len(),
        ..Needs::default()
    }
}

/// The parts that a scene with these needs does without.
pub(super) fn left_out(needs: &Needs, background: Background, dataset: &Dataset) -> Vec<String> {
    let parts = [
        (needs.cascades == 1, "cascades and growing steps (the scene is bounded)"),
        (!needs.alpha && !needs.hdr, "alpha (the images are opaque)"),
        (!needs.hdr, "linear pixels (the images have 8 bits)"),
        (background != Background::Random, "random backgrounds (not asked for)"),
        (dataset.is_hdr, "8-bit pixels (the images are linear)"),
    ];
    let absent = LensKind::ALL.into_iter().filter(|kind| !needs.lenses.contains(kind));
    let absent: Vec<_> = absent.map(LensKind::name).collect();
    let lenses =
        (!absent.is_empty()).then(|| format!("lens models {} (no camera has them)", absent.join("/")));
    let others = parts.into_iter().filter(|(is_left_out, _)| *is_left_out).map(|(_, part)| part.to_owned());
    lenses.into_iter().chain(others).collect()
}
