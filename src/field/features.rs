//! The features of a scene that kernels are linked for: everything else is left out.

use crate::camera::LensKind;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::ops::RangeInclusive;

/// What a scene has, apart from the configuration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFeatures {
    /// The lenses that cameras have; at least one.
    pub lenses: BTreeSet<LensKind>,
    /// Some image has alpha.
    pub alpha: bool,
    /// Pixels are linear floats.
    pub hdr: bool,
    /// Some image has 16 bits.
    pub deep: bool,
    /// Some pixels are ignored.
    pub masks: bool,
    /// Depth is trained on.
    pub depth: bool,
    /// Scene-linear brightness that is 1 in the field: that of a typical pixel; 1 for images of 8 or 16 bits.
    pub grey: f32,
}

impl SceneFeatures {
    /// What `grey` may be: numbers far from it are still in single precision.
    pub const GREY: RangeInclusive<f32> = 1e-25..=1e25;
}

impl Default for SceneFeatures {
    /// One opaque 8-bit photo of a pinhole camera.
    fn default() -> Self {
        Self {
            lenses: [LensKind::Pinhole].into(),
            alpha: false,
            hdr: false,
            deep: false,
            masks: false,
            depth: false,
            grey: 1.0,
        }
    }
}
