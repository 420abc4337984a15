//! Checks of the kernels on an adapter against the f64 reference.
//!
//! A [`Workbench`] is a small plan with all its buffers, and knows what they look like: it puts batches on the
//! device, runs stages and reads what they left. [`Setup`] says what it is built from, [`draw`] makes its inputs.

pub mod draw;
mod parameters;
mod setup;
mod workbench;

pub use setup::Setup;
pub use workbench::{Kept, Outcome, Workbench, visible_cells};
