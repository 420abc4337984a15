//! What knows nothing of radiance fields: charts, image metrics, files, locks, formatting of numbers, and remedies.

#[cfg(feature = "run")]
pub mod chart;
pub mod file;
pub mod format;
pub mod lock;
pub mod metrics;
pub mod remedy;
pub mod statistics;
pub mod temporary;
