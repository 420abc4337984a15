//! The library from within, without starting its program: the reference, datasets, pictures, scenes, presets, charts,
//! how kernels are linked, and training runs that must not break.

mod architecture;
mod chart;
mod configs;
mod corpus;
mod dataset;
mod formats;
mod golden;
mod malformed;
mod photos;
mod reference;
mod scene;
mod scene_box;
mod shaders;
mod stability;
#[path = "../support/mod.rs"]
mod support;
