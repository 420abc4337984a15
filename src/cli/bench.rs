//! `nerf bench`

use clap::{Args, Subcommand};
use std::path::PathBuf;

/// What to measure.
#[derive(Debug, Subcommand)]
pub(crate) enum Bench {
    /// Test PSNR against seconds of training, for several configs and seeds
    Training(Training),
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
    /// Stop each run after this many seconds [default: 300 on a CPU]
    #[arg(long, value_name = "S", value_parser = super::seconds, allow_negative_numbers = true)]
    pub(crate) seconds: Option<f64>,
    /// Stop each run after this many steps [default: 20000 on a GPU]
    #[arg(long, value_name = "N")]
    pub(crate) steps: Option<u32>,
    /// Test views to measure along the way, evenly spaced; the end measures all
    #[arg(long, value_name = "N", default_value = "4", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) views: u32,
}
