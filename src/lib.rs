//! Trains neural radiance fields from posed photos and renders new views of them, on any GPU that `wgpu`
//! reaches and on plain CPUs through a software driver.
//!
//! # The way through
//!
//! ```text
//! transforms.json + images ──> dataset ──> train ──> checkpoint ──> render ──> EXR, PNG, scores
//! ```
//!
//! A [`Dataset`] has cameras and photos from files. A [`Field`] is a radiance field on a device ([`Gpu`]): a [`Trainer`]
//! takes steps (rays, march, density, selection, colour, the fused render·loss·gradient kernel, backward, Adam), a
//! [`Renderer`] shows it to any camera, and a [`Checkpoint`] keeps it on disk. A [`TrainingRun`] is a whole run,
//! with its budget, log, checkpoints and evaluation, reported to an [`Observer`]; the command line is a thin layer on it.
//!
//! Without the default feature `cli` there is no terminal; without `run` there are no files but checkpoints: no datasets,
//! no decoders, no charts, no command line.
//!
//! What stands in which room of the sources, and what must stay true of them, is in `docs/architecture.md`.
//!
//! # Conventions
//!
//! - World space is the dataset's own, in its own units. The cube that the grid covers is internal.
//! - Camera axes are OpenGL's: +X right, +Y up, the camera looks along -Z. Pixel centres lie at `+0.5`.
//! - A field of images in 8 or 16 bits holds display-referred (sRGB) colours, and is composited as such; a field
//!   of OpenEXR or Radiance HDR images holds linear light. Rendered colours are premultiplied by their opacity.
//! - Depth is the mean distance along the view axis, or along the ray where a lens sees sideways and behind
//!   ([`LensKind::depth_is_distance`]), in world units.
//! - Gradients are called `d_<name>` for the derivative of the loss by `<name>`.
//!
//! # Training in code
//!
//! ```no_run
//! # #[cfg(feature = "run")]
//! # fn main() -> anyhow::Result<()> {
//! use nerf::{Config, Dataset, Gpu, Trainer};
//! use std::{path::Path, sync::Arc};
//!
//! let dataset = Dataset::open(Path::new("data/lego"), &Default::default())?;
//! let gpu = Arc::new(Gpu::choose(None)?);
//! let mut trainer = Trainer::on(&gpu, &dataset, Config::for_dataset(&dataset, gpu.is_cpu())?)?;
//! for _ in 0..1000 {
//!     trainer.step(1e-2, None)?;
//! }
//! println!("loss {}", trainer.report()?.loss);
//! # Ok(())
//! # }
//! # #[cfg(not(feature = "run"))]
//! # fn main() {}
//! ```

// The rooms are for the program, the tests and the benches of this package; what is in them may change with every version.
#[doc(hidden)]
pub mod camera;
#[cfg(feature = "run")]
#[doc(hidden)]
pub mod capture;
#[doc(hidden)]
pub mod config;
#[doc(hidden)]
pub mod field;
#[doc(hidden)]
pub mod gpu;
#[doc(hidden)]
pub mod photo;
#[cfg(feature = "run")]
#[doc(hidden)]
pub mod run;
#[doc(hidden)]
pub mod support;
#[cfg(feature = "run")]
#[doc(hidden)]
pub mod verify;

pub use camera::{Bounds, Camera, Lens, LensKind};
pub use config::Config;
pub use field::Field;
pub use field::checkpoint::Checkpoint;
pub use field::renderer::{Renderer, View};
pub use field::trainer::{StepStats, Trainer};
pub use gpu::Gpu;
pub use photo::{Image, Photo};

#[cfg(feature = "run")]
pub use capture::dataset::{Dataset, OpenOptions};
#[cfg(feature = "run")]
pub use run::{Evaluator, Event, Observer, Resolved, RunFolder, TrainOptions, TrainingRun, TrainingSession};
