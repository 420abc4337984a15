//! The radiance field on a device: its parameters and kernels, training it and rendering it.

pub mod checkpoint;
mod constants;
mod demands;
mod features;
pub mod layer;
pub mod lenses;
pub mod link;
pub mod parameters;
mod plan;
pub mod records;
pub mod render;
mod shared;
pub mod silhouette;
pub mod stages;
pub mod train;
mod variants;
pub mod views;
pub mod visibility;
mod workspace;

pub use constants::{RELATIVE_FLOOR, STEP_GROWTH, STEP_SHRINKAGE, dimension};
pub use features::SceneFeatures;
pub use link::Link;
pub use plan::{Plan, Traits, dispatch};
pub use shared::{Camera, Counters, LAYOUTS, Progress, RayResult, RayTarget, Step};
pub use stages::{color, density, march, occupancy, training, viewing};
pub use workspace::Workspace;
