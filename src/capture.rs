//! From files to cameras and photos: reading a dataset, and saying what is wrong with it.

pub mod dataset;
pub mod diagnostics;
pub(crate) mod focus;
pub mod health;
pub mod image_file;
mod point_cloud;
pub(crate) mod scene_box;
mod surfaces;
pub mod unreadable;
