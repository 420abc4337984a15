//! What knows nothing of radiance fields: charts, image metrics, files, locks, formatting of numbers, remedies, and
//! what ends a computation early.

#[cfg(feature = "run")]
pub mod chart;
pub mod file;
pub mod fingerprint;
pub mod format;
pub mod interrupt;
pub mod lock;
pub mod metrics;
pub mod remedy;
pub mod statistics;
pub mod stopwatch;
pub mod temporary;
pub mod transient;
