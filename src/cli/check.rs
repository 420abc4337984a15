//! What `nerf check` takes.

use super::one_of::OneOf;
use clap::Args;
use nerf::config::Accumulation;
use nerf::field::layer::Product;
use nerf::gpu::tensor::TensorMemory;
use std::path::PathBuf;

/// Help of the choice that is left to the plan.
const AUTO: &str = "What training takes on this adapter";

/// `nerf check`
#[derive(Args, Debug)]
pub(crate) struct Check {
    /// Check only the rays of this file of golden rays: what the fused kernel of rendering, loss and gradient makes
    /// of them
    #[arg(long, value_name = "FILE")]
    pub(crate) vectors: Option<PathBuf>,
    /// How gradients of the hash table are summed
    #[arg(long, value_parser = accumulations(), default_value = "auto")]
    pub(crate) accumulation: Accumulation,
    // Written with its path, an option is one of the values, not an argument that may be missing.
    /// Where tensors live
    #[arg(long, value_parser = memories(), default_value = "auto")]
    pub(crate) memory: std::option::Option<TensorMemory>,
    /// How the networks are multiplied: tiles of workgroups, rows per thread, or shared weights
    #[arg(long, value_parser = products(), default_value = "auto")]
    pub(crate) product: std::option::Option<Product>,
}

fn accumulations() -> OneOf<Accumulation> {
    OneOf::named([
        (Accumulation::Auto, AUTO),
        (Accumulation::Ordered, "In the order of the samples, without atomics"),
        (Accumulation::Fixed, "As integers, independent of order"),
        (Accumulation::Long, "As integers, by 64-bit atomics"),
        (Accumulation::Float, "By float atomics"),
        (Accumulation::Exchange, "By compare-and-exchange"),
    ])
}

fn memories() -> OneOf<Option<TensorMemory>> {
    let values = [
        ("auto", AUTO, None),
        ("buffers", "Storage buffers", Some(TensorMemory::Buffers)),
        ("textures", "Textures", Some(TensorMemory::Textures)),
    ];
    OneOf::new(values.map(|(name, help, memory)| (name.to_owned(), help, memory)))
}

fn products() -> OneOf<Option<Product>> {
    let values = [
        ("auto", AUTO, None),
        (
            "shared",
            "Four rows per thread, and threads that read weights together",
            Some(Product::SharedWeights),
        ),
        ("tiled", "Tiles of rows and weights that workgroups read together", Some(Product::Tiled)),
        ("1", "One row per thread", Some(Product::Rows(1))),
        ("2", "Two rows per thread", Some(Product::Rows(2))),
        ("4", "Four rows per thread", Some(Product::Rows(4))),
    ];
    OneOf::new(values.map(|(name, help, product)| (name.to_owned(), help, product)))
}
