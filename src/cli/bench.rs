//! `nerf bench`

use clap::{Args, Subcommand};
use std::path::PathBuf;

/// What to measure.
#[derive(Debug, Subcommand)]
pub(crate) enum Bench {
    /// Test PSNR against seconds of training, for several configs and seeds
    Training(Training),
    /// Error of rendered rays against the step, where the exact integral is known
    Quadrature(Quadrature),
    /// The two sums of the transmittance on thick slabs, and two forms of the gradient on stiff rays
    Equations(Equations),
}

/// `nerf bench training`
#[derive(Args, Debug)]
pub(crate) struct Training {
    /// A folder with transforms.json or transforms_train.json, or such a file
    pub(crate) dataset: PathBuf,
    /// Folder to write training.json, training.csv and training.svg to
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// JSON file with the settings that differ from the defaults: one curve; may be repeated [default: the defaults]
    #[arg(long, value_name = "FILE")]
    pub(crate) config: Vec<PathBuf>,
    /// Change one setting in every config, for example grid.levels=8; may be repeated
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub(crate) set: Vec<String>,
    /// Train every config with the seeds 0 to N - 1
    #[arg(long, value_name = "N", conflicts_with = "seed", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) seeds: Option<u32>,
    /// Train every config with this seed; may be repeated [default: the config's]
    #[arg(long, value_name = "K")]
    pub(crate) seed: Vec<u32>,
    /// Stop each training after this many seconds [default: 300 on a CPU]
    #[arg(long, value_name = "S", value_parser = super::seconds, allow_negative_numbers = true)]
    pub(crate) seconds: Option<f64>,
    /// Stop each training after this many steps [default: 20000 on a GPU]
    #[arg(long, value_name = "N")]
    pub(crate) steps: Option<u32>,
    /// Test views to measure along the way, evenly spaced; the end measures all
    #[arg(long, value_name = "N", default_value = "4", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) views: u32,
}

/// `nerf bench quadrature`
#[derive(Args, Debug)]
pub(crate) struct Quadrature {
    /// Folder to write quadrature.json, quadrature.csv and quadrature.svg to
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Rays with different phases of their samples
    #[arg(long, value_name = "N", default_value = "4096", value_parser = clap::value_parser!(u32).range(1..=65_536))]
    pub(crate) rays: u32,
    /// Times that each batch is run; its time is the median
    #[arg(long, value_name = "N", default_value = "5", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) repeats: u32,
}

/// `nerf bench equations`
#[derive(Args, Debug)]
pub(crate) struct Equations {
    /// Folder to write equations.json and equations.md to
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// File of golden rays; may be repeated [default: rays computed in 64 bits]
    #[arg(long, value_name = "FILE")]
    pub(crate) vectors: Vec<PathBuf>,
}
