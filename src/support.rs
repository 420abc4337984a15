//! What knows nothing of radiance fields: charts, image metrics, files, numbers and remedies in words.

#[cfg(feature = "run")]
pub mod chart;
pub mod file;
pub mod format;
pub mod metrics;
pub mod remedy;
