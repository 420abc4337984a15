//! One file per subcommand: glue, printing and progress around the library.

mod adapters;
mod bench;
mod check;
mod eval;
mod generate;
mod info;
mod render;
mod report;
mod train;

use crate::cli::photo_flags::PhotoFlags;
use crate::cli::{Cli, Command, Global};
use crate::console::Console;
use crate::narrator::Narrator;
use crate::signals::Signals;
use anyhow::{Context, Result};
use nerf::capture::dataset::{Dataset, OpenOptions};
use nerf::field::checkpoint::Metadata;
use nerf::gpu::{Gpu, adapter};
use nerf::run::{Differences, TrainedField};
use nerf::support::format::count;
use serde_json::Value;
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

/// Runs the subcommand.
pub(crate) fn run(cli: &Cli, signals: &Signals) -> Result<()> {
    let session = Session { global: &cli.global, console: Console::new(&cli.global), signals };
    match &cli.command {
        Command::Train(args) => train::run(args, &session),
        Command::Render(args) => render::run(args, &session),
        Command::Eval(args) => eval::run(args, &session),
        Command::Report(args) => report::run(args, &session),
        Command::Info(args) => info::run(args, &session),
        Command::Generate(args) => generate::run(args, &session),
        Command::Bench(what) => bench::run(what, &session),
        Command::Check(args) => check::run(args, &session),
        Command::Adapters => adapters::run(&session),
    }
}

/// A failure whose result, with all there is to say about it, was printed already.
#[derive(Debug)]
pub(crate) struct Failed(String);

impl std::fmt::Display for Failed {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Failed {}

/// What every subcommand is given.
#[derive(Clone, Copy, Debug)]
struct Session<'a> {
    global: &'a Global,
    console: Console,
    signals: &'a Signals,
}

impl Session<'_> {
    /// Opens the adapter asked for.
    fn open_gpu(&self) -> Result<Arc<Gpu>> {
        let mut gpu = Gpu::open(&adapter::choose(self.global.adapter.as_deref())?)?;
        gpu.interrupt = self.signals.interrupt.clone();
        let info = &gpu.info;
        self.console.detail(&format!(
            "adapter {} ({:?}, {:?}, {} {})",
            info.name, info.device_type, info.backend, info.driver, info.driver_info
        ));
        Ok(Arc::new(gpu))
    }

    /// Reads the checkpoint that `run` stands for.
    fn load_field(&self, run: &Path) -> Result<TrainedField> {
        let field = TrainedField::load(run)?;
        field.warning().iter().for_each(|warning| self.console.warn(warning));
        let Metadata { step, seconds, adapter, dataset, .. } = field.metadata();
        let steps = count(*step as usize, "step");
        let path = field.path().display();
        self.console.detail(&format!("{path}: {steps} in {seconds:.1} s on {adapter}, trained on {dataset}"));
        Ok(field)
    }

    /// Prints the events of a run.
    fn narrator(&self) -> Narrator {
        Narrator::new(self.console)
    }

    /// From now on a signal raises the interrupt, also the device's, and waits: there is something to bring to an end. Fails
    /// where one came before.
    fn end_gracefully(&self) -> Result<()> {
        self.signals.end_gracefully();
        self.check_interrupt()
    }

    /// Fails where a signal has asked for an end.
    fn check_interrupt(&self) -> Result<()> {
        Ok(self.signals.interrupt.check()?)
    }

    /// Prints the result: `json` if asked for, else `text`.
    fn print(&self, json: &Value, text: &str) -> Result<()> {
        self.signals.claim_answer();
        let mut out = std::io::stdout().lock();
        let printed = match self.global.json {
            true => writeln!(out, "{json}"),
            false => writeln!(out, "{text}"),
        };
        printed.and_then(|()| out.flush()).context("the result could not be printed")
    }
}

/// Warns where frames of a dataset are not what the run had under their names.
fn warn_of_differences(
    metadata: &Metadata,
    (dataset, frames): (&Dataset, &[usize]),
    session: &Session<'_>,
) -> Result<()> {
    if let Some(what) = Differences::between(metadata, dataset, frames)?.describe() {
        session.console.warn(&format!(
            "{what} are not those of the run, which began with {}: this is another dataset, or it was changed",
            metadata.dataset
        ));
    }
    Ok(())
}

/// Opens a dataset to compare a field with: the photos are read as the command line says, else as for training.
fn open_to_compare(path: &Path, reading: &PhotoFlags, metadata: &Metadata) -> Result<Dataset> {
    let reading = reading.over(metadata.reading.clone());
    Dataset::open(path, &OpenOptions { reading, ..OpenOptions::default() })
}
