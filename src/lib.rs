//! Trains neural radiance fields from posed photos and renders new views of them, on any GPU that `wgpu`
//! reaches and on plain CPUs through a software driver.
//!
//! # The way through
//!
//! ```text
//! transforms.json + images ──> dataset ──> train ──> checkpoint ──> render ──> EXR, PNG, scores
//! ```
//!
//! [`dataset`] reads cameras and photos, [`health`] says what is wrong with them, and [`views::Views`] brings them to
//! the device, where [`memory`] has said that there is room. [`train::Trainer`] owns the field on the device and takes steps: rays,
//! march, density, selection, colour, the fused render·loss·gradient kernel, backward, Adam. [`checkpoint`]
//! keeps a field on disk. [`render::Renderer`] shows it to any camera. The command line on top of it is the
//! binary of this package.
//!
//! Underneath, [`model`] lays out the parameters, [`kernels`] lists what runs on the device, and [`gpu`] knows
//! how: choosing an adapter, linking WGSL, binding by name. [`mod@reference`] is the same mathematics in plain
//! `f64`, which the kernels are tested against, and [`scene`] renders scenes whose truth is known.
//!
//! # Conventions
//!
//! - World space is the dataset's own, in its own units. The cube that the grid covers is internal.
//! - Camera axes are OpenGL's: +X right, +Y up, the camera looks along -Z. Pixel centres lie at `+0.5`.
//! - A field of images in 8 or 16 bits holds display-referred (sRGB) colours, and is composited as such; a field
//!   of OpenEXR or Radiance HDR images holds linear light. Rendered colours are premultiplied by their opacity.
//! - Depth is the mean distance along the view axis, or along the ray where a lens sees sideways and behind
//!   ([`camera::LensKind::depth_is_distance`]), in world units.
//! - Gradients are called `d_<name>` for the derivative of the loss by `<name>`.
//!
//! # A training in code
//!
//! ```no_run
//! use nerf::{camera::LensKind, config::Config, dataset::Dataset, gpu, kernels::{Needs, Plan}};
//! use nerf::{model, train, views::Views};
//! use std::{path::Path, sync::Arc};
//!
//! # fn main() -> anyhow::Result<()> {
//! let dataset = Dataset::open(Path::new("data/lego"), &Default::default())?;
//! let mut images = Vec::new();
//! dataset.stream(&dataset.train, false, &mut |_, photo| Ok(images.push(photo.image)))?;
//! let cameras: Vec<_> = dataset.train.iter().map(|&i| dataset.frames[i].camera.clone()).collect();
//! let gpu = Arc::new(gpu::Gpu::open(&gpu::adapter::choose(None)?)?);
//! let config = Config::default();
//! let finest = model::finest_resolution(&config.grid, &dataset.bounds, &cameras);
//! let layout = model::Layout::new(&config, finest);
//! let needs = Needs {
//!     lenses: LensKind::among(&cameras),
//!     alpha: images.iter().any(|image| image.has_alpha),
//!     hdr: dataset.is_hdr,
//!     cascades: dataset.bounds.cascades,
//!     cameras: cameras.len(),
//!     ..Needs::default()
//! };
//! let plan = Plan::new(&gpu, config, layout, needs);
//! let mut views = Views::new(&gpu, &plan, &cameras, &dataset.bounds)?;
//! for image in images {
//!     views.add(&image.into())?;
//! }
//! let mut trainer = train::Trainer::new(&gpu, plan, views)?;
//! for _ in 0..1000 {
//!     trainer.step(1e-2, None)?;
//! }
//! println!("loss {}", trainer.report()?.loss);
//! # Ok(())
//! # }
//! ```

pub mod camera;
pub mod chart;
pub mod check;
pub mod checkpoint;
pub mod config;
pub mod dataset;
pub mod depths;
pub mod file;
pub mod gpu;
pub mod health;
pub mod image;
pub mod kernels;
pub mod memory;
pub mod metrics;
pub mod model;
pub mod orbit;
pub mod picture;
pub mod reference;
pub mod render;
pub mod report;
pub mod results;
pub mod scene;
pub mod schedule;
pub mod train;
pub mod views;
pub mod visibility;
pub mod words;
