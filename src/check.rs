//! Checks of the kernels on an adapter against the f64 reference.
//!
//! A [`Workbench`] is a small plan with all its buffers, and knows what they look like: it puts batches on the
//! device, runs stages and reads what they left. [`Setup`] says what it is built from, [`draw`] makes its inputs.
//! A [`Subject`] is the adapter with the variants to check; each check returns [`Tally`]s.

pub mod draw;
pub mod exponential;
pub mod fused;
pub mod hard_rays;
mod parameters;
mod probe;
mod setup;
mod subject;
pub mod tally;
mod workbench;

pub use setup::Setup;
pub use subject::{Forced, Subject};
pub use tally::Tally;
pub use workbench::{Kept, Outcome, Workbench, visible_cells};
