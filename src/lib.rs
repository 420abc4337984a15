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
//! use nerf::{capture::dataset::Dataset, config::Config, field::train::Trainer, gpu};
//! use std::{path::Path, sync::Arc};
//!
//! # fn main() -> anyhow::Result<()> {
//! let dataset = Dataset::open(Path::new("data/lego"), &Default::default())?;
//! let gpu = Arc::new(gpu::Gpu::open(&gpu::adapter::choose(None)?)?);
//! let mut trainer = Trainer::on(&gpu, &dataset, Config::for_dataset(&dataset, gpu.is_cpu())?)?;
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
