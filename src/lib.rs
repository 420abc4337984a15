//! Trains neural radiance fields from posed photos and renders new views of them, on any GPU that `wgpu`
//! reaches and on plain CPUs through a software driver.
//!
//! # The way through
//!
//! ```text
//! transforms.json + images ──> dataset ──> train ──> checkpoint ──> render ──> EXR, PNG, scores
//! ```
//!
//! [`capture`] reads cameras and photos from files and says what is wrong with them; [`field`] is the radiance field
//! on a device: [`field::train::Trainer`] takes steps (rays, march, density, selection, colour, the fused
//! render·loss·gradient kernel, backward, Adam), [`field::render::Renderer`] shows it to any camera,
//! [`field::checkpoint`] keeps it on disk. [`run`] is a training run as a whole, and the command line on top of it is the
//! binary of this package.
//!
//! Underneath, [`camera`], [`photo`] and [`config`] are plain values, and [`gpu`] knows adapters, linking and binding by
//! name. [`verify`] has the same mathematics in plain `f64`, which the kernels are tested against, and scenes whose
//! truth is known.
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
//! use nerf::{camera::LensKind, capture::dataset::Dataset, config::Config, gpu};
//! use nerf::field::{Field, Needs, Plan, Space, layout, train, views::Views};
//! use std::{path::Path, sync::Arc};
//!
//! # fn main() -> anyhow::Result<()> {
//! let dataset = Dataset::open(Path::new("data/lego"), &Default::default())?;
//! let mut images = Vec::new();
//! dataset.stream(&dataset.train, false, &mut |_, photo| Ok(images.push(photo.image)))?;
//! let cameras: Vec<_> = dataset.train.iter().map(|&i| dataset.frames[i].camera.clone()).collect();
//! let gpu = Arc::new(gpu::Gpu::open(&gpu::adapter::choose(None)?)?);
//! let mut config = Config::default();
//! let space = Space::from(&dataset.bounds);
//! config.grid.finest = layout::finest_resolution(&config.grid, &space, &cameras);
//! let needs = Needs {
//!     lenses: LensKind::among(&cameras),
//!     alpha: images.iter().any(|image| image.has_alpha),
//!     hdr: dataset.is_hdr,
//!     ..Needs::default()
//! };
//! let plan = Plan::new(&gpu, config, needs, space);
//! let mut views = Views::new(&gpu, &plan, &cameras)?;
//! for image in images {
//!     views.add(&image.into())?;
//! }
//! let mut trainer = train::Trainer::new(Field::new(&gpu, plan)?, views)?;
//! for _ in 0..1000 {
//!     trainer.step(1e-2, None)?;
//! }
//! println!("loss {}", trainer.report()?.loss);
//! # Ok(())
//! # }
//! ```

pub mod camera;
pub mod capture;
pub mod config;
pub mod field;
pub mod gpu;
pub mod photo;
pub mod run;
pub mod support;
pub mod verify;
