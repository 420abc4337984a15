//! What `nerf check` takes.

use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// `nerf check`
#[derive(Args, Debug)]
pub(crate) struct Check {
    /// Check only the rays of this file of golden rays: what the fused kernel of rendering, loss and gradient makes
    /// of them
    #[arg(long, value_name = "FILE")]
    pub(crate) vectors: Option<PathBuf>,
    /// How gradients of the hash table are summed
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) accumulation: AccumulationName,
    /// Where tensors live
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) memory: MemoryName,
    /// How the networks are multiplied: rows per thread, or shared weights
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) product: ProductName,
}

/// An accumulation by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum AccumulationName {
    /// What a training takes on this adapter
    Auto,
    /// In the order of the samples, without atomics
    Ordered,
    /// As integers, independent of order
    Fixed,
    /// By float atomics
    Float,
    /// By compare-and-exchange
    Exchange,
}

/// A memory by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum MemoryName {
    /// What a training takes on this adapter
    Auto,
    /// Storage buffers
    Buffers,
    /// Textures
    Textures,
}

/// A matrix product by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum ProductName {
    /// What a training takes on this adapter
    Auto,
    /// Four rows per thread, and threads that read weights together
    Shared,
    /// One row per thread
    #[value(name = "1")]
    One,
    /// Two rows per thread
    #[value(name = "2")]
    Two,
    /// Four rows per thread
    #[value(name = "4")]
    Four,
}
