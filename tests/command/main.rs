//! The program as its users start it: every command, what it says and writes, and the page about a training run.
//!
//! Training runs need an adapter; a software driver (lavapipe) is enough.

mod bench;
mod check;
mod checkpoints;
mod cli;
mod devices;
mod endurance;
mod info;
mod program;
mod render;
mod report;
mod scores;
mod sidecars;
#[cfg(unix)]
mod signals;
#[path = "../support/mod.rs"]
mod support;
mod training;
