//! A training run as a whole, without a terminal.

pub mod depths;
pub mod memory;
mod onlookers;
pub mod report;
