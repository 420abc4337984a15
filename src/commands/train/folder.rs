//! The folder of a training: what may be in it, and what is written to it.

use super::log::Log;
use super::setup::Setup;
use crate::cli::Train;
use anyhow::{Context, Result, bail};
use nerf::field::checkpoint::{self, Checkpoint};
use nerf::run::report;
use nerf::support::file::write_atomically;
use std::fs;
use std::io::{ErrorKind, Write};
use std::path::PathBuf;

const LOG: &str = "log.jsonl";
const CONFIG: &str = "config.json";

/// The folder.
#[derive(Debug)]
pub(super) struct RunFolder {
    path: PathBuf,
    /// The training to go on with.
    pub(super) checkpoint: Option<Checkpoint>,
}

impl RunFolder {
    /// Checks that the folder may be used; touches nothing.
    pub(super) fn inspect(args: &Train) -> Result<Self> {
        let (path, show) = (args.out.clone(), args.out.display());
        if args.resume {
            let file = checkpoint::locate(&path).context("there is nothing to resume")?;
            return Ok(Self { checkpoint: Some(Checkpoint::load(&file)?), path });
        }
        let is_used = match fs::read_dir(&path) {
            Ok(mut entries) => entries.next().is_some(),
            Err(error) if error.kind() == ErrorKind::NotFound => false,
            Err(error) => return Err(error).with_context(|| format!("{show} cannot be used as a folder")),
        };
        if is_used && !args.overwrite {
            bail!(
                "the folder {show} is not empty; name another one, or add --resume to go on with the training in \
                 it, or --overwrite to replace it"
            );
        }
        Ok(Self { path, checkpoint: None })
    }

    /// Where the checkpoint goes.
    pub(super) fn checkpoint_path(&self) -> PathBuf {
        self.path.join(checkpoint::FILE)
    }

    /// Replaces or goes on with what an earlier training left; the configuration is written, and the log open.
    pub(super) fn begin(&self, setup: &Setup) -> Result<Log> {
        if setup.state.is_none() {
            for name in [checkpoint::FILE, LOG, CONFIG, report::FILE] {
                remove(&self.path.join(name))?;
            }
        }
        write_atomically(&self.path.join(CONFIG), |file| {
            serde_json::to_writer_pretty(&mut *file, &setup.about.config)?;
            Ok(file.write_all(b"\n")?)
        })?;
        let log = self.path.join(LOG);
        match setup.state {
            Some(_) => Log::resume(&log, setup.about.step),
            None => Log::create(&log),
        }
    }
}

fn remove(path: &std::path::Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(error).with_context(|| format!("removing {}", path.display()))
        }
        _ => Ok(()),
    }
}
