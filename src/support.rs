//! What knows nothing of radiance fields: charts, image metrics, files, formatting of numbers, and remedies.

#[cfg(feature = "run")]
pub mod chart;
pub mod file;
pub mod format;
pub mod metrics;
pub mod remedy;
pub mod statistics;
