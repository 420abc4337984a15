//! The part of the world that is modelled: cubes about one centre.

use super::Ray;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// The scene box, in world space: an inner cube that holds the subject, doubled about its centre
/// `cascades - 1` times to take in the background.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Centre of all the cubes.
    pub center: DVec3,
    /// Half the side of the inner cube, in world units.
    pub half: f64,
    /// Number of cubes, 1 to 8.
    pub cascades: u32,
    /// How the box was found, one sentence.
    pub source: String,
    /// Whether nothing tells how far the scene reaches.
    #[serde(default)]
    pub is_guess: bool,
}

impl Bounds {
    /// Half the side of the whole box, in world units.
    pub fn outer_half(&self) -> f64 {
        self.half * f64::from(1u32 << (self.cascades - 1))
    }

    /// Lower corner of the whole box.
    pub fn min(&self) -> DVec3 {
        self.center - self.outer_half()
    }

    /// Upper corner of the whole box.
    pub fn max(&self) -> DVec3 {
        self.center + self.outer_half()
    }

    /// Whether a ray meets the cube of this half side about the centre.
    #[must_use]
    pub fn meets(&self, half: f64, ray: &Ray) -> bool {
        let inverse = ray.direction.recip();
        let middle = self.center - ray.origin;
        let (a, b) = ((middle - half) * inverse, (middle + half) * inverse);
        a.max(b).min_element() > a.min(b).max_element().max(0.0)
    }
}
