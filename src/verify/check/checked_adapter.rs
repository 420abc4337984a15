//! An adapter under check, and the variants its kernels are linked from.

use super::{Setup, Workbench};
use crate::config::Accumulation;
use crate::field::layer::Product;
use crate::field::{Capabilities, Plan, optimize::accumulation_name};
use crate::gpu::Gpu;
use crate::gpu::tensor::TensorMemory;
use anyhow::{Result, ensure};
use std::sync::Arc;

/// Variants to check instead of those that the plan chooses for the adapter; `None` leaves them to it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Forced {
    /// How the table's gradients are summed.
    pub accumulation: Option<Accumulation>,
    /// Where tensors live.
    pub memory: Option<TensorMemory>,
    /// How matrix products are written.
    pub product: Option<Product>,
}

/// An adapter under check.
#[derive(Clone, Debug)]
pub struct CheckedAdapter {
    /// The adapter.
    pub gpu: Arc<Gpu>,
    forced: Forced,
}

impl CheckedAdapter {
    /// The adapter with these variants.
    ///
    /// # Errors
    /// When it cannot run one of them; the message says what it lacks.
    pub fn new(gpu: &Arc<Gpu>, forced: Forced) -> Result<Self> {
        let name = &gpu.info.name;
        if let Some(accumulation) = forced.accumulation {
            Capabilities::of(gpu).check(accumulation, name)?;
        }
        ensure!(
            forced.memory != Some(TensorMemory::Textures) || gpu.has(crate::gpu::tensor::TEXTURE_FEATURES),
            "tensors in textures need textures that a kernel reads and writes, and the adapter '{name}' does not \
             have them; leave it out, or ask for buffers"
        );
        ensure!(
            forced.product != Some(Product::SharedWeights) || gpu.has_subgroups_of(8),
            "shared weights need subgroups of a multiple of 8 threads, and those of the adapter '{name}' have {}; \
             leave it out, or ask for tiled, or for 1, 2 or 4 rows",
            gpu.info.subgroup_min_size
        );
        Ok(Self { gpu: Arc::clone(gpu), forced })
    }

    /// `setup` with the forced variants.
    #[must_use]
    pub fn setup(&self, mut setup: Setup) -> Setup {
        setup.config.accumulation = self.forced.accumulation.unwrap_or(setup.config.accumulation);
        setup.memory = self.forced.memory.or(setup.memory);
        setup.product = self.forced.product.or(setup.product);
        setup
    }

    /// A workbench of `setup` with the forced variants.
    ///
    /// # Errors
    /// As [`Workbench::new`].
    pub fn workbench(&self, setup: Setup) -> Result<Workbench> {
        Workbench::new(&self.gpu, &self.setup(setup))
    }

    /// Which variants are checked, and why these.
    ///
    /// # Errors
    /// Never: the plan is a valid one.
    pub fn describe(&self) -> Result<String> {
        let Plan { accumulation, memory, product, .. } = self.setup(Setup::tiny()).plan(&self.gpu)?;
        let memory = match memory {
            TensorMemory::Buffers => "tensors in buffers",
            TensorMemory::Textures => "tensors in textures",
        };
        let rows = match product {
            Product::SharedWeights => "4 rows per thread and shared weights".into(),
            Product::Tiled => "tiles per workgroup".into(),
            Product::Rows(1) => "1 row per thread".into(),
            Product::Rows(rows) => format!("{rows} rows per thread"),
        };
        let parts = [
            (accumulation_name(accumulation).to_owned(), self.forced.accumulation.is_some()),
            (memory.to_owned(), self.forced.memory.is_some()),
            (format!("matrix products of {rows}"), self.forced.product.is_some()),
        ];
        let kind = if self.gpu.is_cpu() { "a CPU adapter" } else { "a GPU" };
        let why = match parts.iter().filter(|(_, is_forced)| *is_forced).count() {
            0 => format!(": what training takes on {kind}"),
            3 => String::new(),
            _ => format!("; the rest is what training takes on {kind}"),
        };
        let named = parts.map(|(name, is_forced)| name + if is_forced { " (asked for)" } else { "" });
        Ok(named.join(", ") + &why)
    }
}
