//! The stages of a step and of a round of a view, in their order: one file per stage.

pub mod color;
pub mod density;
pub mod march;
pub mod occupancy;
pub mod training;
pub mod viewing;
