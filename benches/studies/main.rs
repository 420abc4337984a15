//! Numerical studies: what is left of an error, and of which step and in which arithmetic.
//!
//! ```text
//! cargo bench --bench studies -- quadrature --out DIR
//! cargo bench --bench studies -- equations --out DIR
//! ```
//!
//! They render rays whose results are known with the kernels of training, and with the f64 reference beside them.
//! The tests include this file: what is here is compiled there too.

pub(crate) mod equations;
pub(crate) mod quadrature;

use anyhow::Result;
use clap::{CommandFactory, Parser, Subcommand};
use nerf::gpu::{Gpu, adapter};
use serde_json::Value;
use std::io::Write;
use std::sync::Arc;

/// Studies the numerics of compositing on rays whose results are known.
#[derive(Debug, Parser)]
#[command(bin_name = "cargo bench --bench studies --")]
pub(crate) struct Args {
    /// None where `cargo bench` runs all benches: the help is printed then.
    #[command(subcommand)]
    pub(crate) study: Option<Study>,
    /// The adapter: an index of `nerf adapters`, or parts of its name and backend [default: the first]
    #[arg(long, global = true)]
    adapter: Option<String>,
    /// Print one JSON object
    #[arg(long, global = true)]
    json: bool,
    /// What cargo adds
    #[arg(long, global = true, hide = true)]
    bench: bool,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Study {
    /// Error of rendered rays against the step, where the exact integral is known
    Quadrature(quadrature::Quadrature),
    /// The two sums of the transmittance on thick slabs, and two forms of the gradient on stiff rays
    Equations(equations::Equations),
}

/// What a study found.
#[derive(Debug)]
pub(crate) struct Outcome {
    /// For programs.
    pub(crate) json: Value,
    /// For readers.
    pub(crate) text: String,
}

fn main() -> Result<()> {
    let args = Args::parse();
    let Some(study) = &args.study else { return Ok(Args::command().print_help()?) };
    let Outcome { json, text } = study.run(args.adapter.as_deref())?;
    let text = if args.json { json.to_string() } else { text };
    Ok(writeln!(std::io::stdout(), "{text}")?)
}

impl Study {
    /// Runs it on the adapter of that name.
    pub(crate) fn run(&self, adapter: Option<&str>) -> Result<Outcome> {
        let gpu = Arc::new(Gpu::open(&adapter::choose(adapter)?)?);
        match self {
            Self::Quadrature(args) => quadrature::run(args, &gpu),
            Self::Equations(args) => equations::run(args, &gpu),
        }
    }
}

fn say(text: &str) {
    // A lost line of progress is no reason to fail.
    let _ = writeln!(std::io::stderr(), "{text}");
}
