//! x
#![allow(missing_docs)]
pub mod camera;
pub mod config;
pub mod dataset;
pub mod file;
pub mod gpu;
pub mod image;
pub mod kernels;
pub mod metrics;
pub mod model;
pub mod reference;
pub mod render;
pub mod scene;
pub mod train;
