//! The f64 oracle: every kernel's formula, written out straight and slowly.
//!
//! These modules are the specification of the WGSL kernels; one file per part, the same names on both
//! sides. `nerf check` and the tests compare the kernels with them. Nothing here is meant to be fast.
//!
//! - *Box space* is the internal unit cube `[0, 1]³` around the scene; its *inner cube*, centred, has the
//!   side `2^-(C-1)` where `C` is the number of cascades, so it is the whole box when `C = 1`.
//! - Gradients are named `d_<name>` and mean ∂loss/∂name.
//! - A ray's channels are red, green, blue, opacity: `[r, g, b, α]`.
//! - Every function returns finite numbers for every finite input of single-precision size.

use serde::{Deserialize, Serialize};

pub mod activation;
pub mod adam;
pub mod composite;
pub mod grid;
pub mod harmonics;
pub mod lens;
pub mod loss;
pub mod march;
pub mod mlp;
pub mod model;
pub mod occupancy;
pub mod random;
pub mod selection;
pub mod step;
pub mod vectors;

/// The colours that a field predicts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ColorRange {
    /// Low dynamic range, display-referred sRGB in `[0, 1]`.
    #[default]
    Ldr,
    /// High dynamic range, linear light from 0 to about 10⁵.
    Hdr,
}
