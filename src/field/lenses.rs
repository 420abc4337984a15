//! Which lenses a kernel links: those that its cameras have, behind one name.

use crate::camera::LensKind;
use std::collections::BTreeSet;

/// The file of a lens, and the prefix of its functions.
pub(super) fn file(kind: LensKind) -> String {
    kind.name().to_lowercase()
}

/// Names of the lenses that no camera has.
pub(super) fn absent(kinds: &BTreeSet<LensKind>) -> impl Iterator<Item = &'static str> {
    LensKind::ALL.into_iter().filter(|kind| !kinds.contains(kind)).map(LensKind::name)
}

/// WGSL of `lens_ray` and `lens_depth` for cameras with lenses of `kinds`, at least one: a call where there is one
/// kind, a choice by the camera's lens where there are several.
#[must_use]
pub fn choice(kinds: &BTreeSet<LensKind>) -> String {
    let ray = |kind| format!("{}_ray(camera, plane)", file(kind));
    let depth = |kind: LensKind| {
        let along = if kind.depth_is_distance() { "ray" } else { "axis" };
        format!("depth_along_{along}(camera, toward)")
    };
    let rays = function("lens_ray(camera: Camera, plane: vec2<f32>) -> LensRay", kinds, ray);
    let depths = function("lens_depth(camera: Camera, toward: vec3<f32>) -> f32", kinds, depth);
    rays + &depths
}

/// What the shaders call a kind of lens: `Camera::lens`.
pub(super) fn number(kind: LensKind) -> u32 {
    kind as u32
}

/// A function that returns `call` of the camera's lens; a choice only where the kinds differ.
fn function(head: &str, kinds: &BTreeSet<LensKind>, call: impl Fn(LensKind) -> String) -> String {
    let mut cases: Vec<(u32, String)> = kinds.iter().map(|&kind| (number(kind), call(kind))).collect();
    let default = cases.pop().map(|(_, call)| format!("return {call};")).unwrap_or_default();
    if cases.iter().all(|(_, call)| default == format!("return {call};")) {
        return format!("fn {head} {{\n    {default}\n}}\n");
    }
    let cases: String = cases
        .iter()
        .map(|(number, call)| format!("        case {number}u: {{ return {call}; }}\n"))
        .collect();
    format!("fn {head} {{\n    switch camera.lens {{\n{cases}        default: {{ {default} }}\n    }}\n}}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_lens_is_called_and_several_are_chosen_from() {
        let one = choice(&BTreeSet::from([LensKind::OpenCv]));
        assert!(one.contains("return opencv_ray(camera, plane);") && !one.contains("switch"));
        assert!(one.contains("return depth_along_axis(camera, toward);"));
        let alike = choice(&BTreeSet::from([LensKind::Pinhole, LensKind::OpenCv]));
        assert_eq!(alike.matches("switch").count(), 1, "{alike}");
        assert!(alike.contains("case 0u: { return pinhole_ray(camera, plane); }"));
        assert!(alike.contains("default: { return opencv_ray(camera, plane); }"));
        let all = choice(&LensKind::ALL.into());
        assert_eq!((all.matches("switch").count(), all.matches("case").count()), (2, 8), "{all}");
        assert!(all.contains("case 2u: { return depth_along_ray(camera, toward); }"));
    }
}
