//! The mathematics once more in `f64`, the kernels compared with it, and scenes whose truth is known.

pub mod check;
pub mod reference;
pub mod scene;
