//! The folder of a run: the names in it, what may be in it before, and what is written to it.

use super::log::Log;
use super::log_writer::LogWriter;
use crate::config::Config;
use crate::field::checkpoint::{self, Opened};
use crate::support::file::{behind_links, write_json};
use crate::support::lock::{FolderLock, is_used};
use crate::support::remedy::{Advised, Remedy};
use anyhow::{Context, Result, bail};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The folder of a run. Where one is to be written, no other process writes to it as long as this value lives.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
    /// `None` where it is only read.
    lock: Option<FolderLock>,
}

impl RunFolder {
    /// The file with the field and the state of its training.
    pub const CHECKPOINT: &'static str = checkpoint::FILE;
    /// The file with a row per block of steps.
    pub const LOG: &'static str = "log.jsonl";
    /// The file with the resolved configuration.
    pub const CONFIG: &'static str = "config.json";
    /// The file with the page about the run.
    pub const REPORT: &'static str = "report.html";

    /// A folder that is only read, and need not be there yet; nothing is touched.
    #[must_use]
    pub fn new(path: &Path) -> Self {
        Self { path: path.to_owned(), lock: None }
    }

    fn locked(path: &Path) -> Result<Self> {
        Ok(Self { path: path.to_owned(), lock: Some(FolderLock::alone(path)?) })
    }

    /// The folder that `run`, itself or a file in it, stands for.
    ///
    /// # Errors
    /// When it has neither a checkpoint nor a log.
    pub fn find(run: &Path) -> Result<Self> {
        let path = if run.is_file() { run.parent().unwrap_or(run) } else { run };
        let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
        let is_known = [Self::CHECKPOINT, Self::LOG].into_iter().any(|file| path.join(file).is_file());
        if !is_known {
            let (show, [checkpoint, log]) = (run.display(), [Self::CHECKPOINT, Self::LOG]);
            let found = format!("{show} has neither {checkpoint} nor {log}; expected ");
            bail!(Advised::new(found, Remedy::RunFolder, ""));
        }
        Ok(Self::new(path))
    }

    /// A folder for a new run, which must not hold anything.
    ///
    /// # Errors
    /// When it does, is no folder, cannot be written to, or another process trains into it.
    pub fn unused(path: &Path) -> Result<Self> {
        is_used(path)?;
        let folder = Self::locked(path)?;
        if is_used(path)? {
            let found = format!("the folder {} is not empty; ", path.display());
            bail!(Advised::new(found, Remedy::UsedFolder, ""));
        }
        Ok(folder)
    }

    /// A folder for a new run, which replaces what an earlier one left.
    ///
    /// # Errors
    /// When it is no folder, cannot be written to, or another process trains into it.
    pub fn to_overwrite(path: &Path) -> Result<Self> {
        is_used(path)?;
        Self::locked(path)
    }

    /// The folder of a run to go on with, and its newest checkpoint that can be used.
    ///
    /// # Errors
    /// When there is no checkpoint, it cannot be used, or another process trains into the folder.
    pub fn to_resume(path: &Path) -> Result<(Self, Opened)> {
        let locate = || checkpoint::locate(path).context("there is nothing to resume");
        if !path.exists() {
            locate()?;
        }
        // Before the checkpoint is read, which another process might replace.
        let folder = Self::locked(path)?;
        locate()?;
        Ok((folder, Opened::of(path)?))
    }

    /// The folder of a run to go on with, and its newest checkpoint that can be used. Without any it is a folder for a new run, which replaces what an
    /// earlier one left that ended before it saved.
    ///
    /// # Errors
    /// When it is no folder, cannot be written to, its checkpoint cannot be used, or another process trains into it.
    pub fn to_resume_or_start(path: &Path) -> Result<(Self, Option<Opened>)> {
        let folder = Self::to_overwrite(path)?;
        let newest = fs::metadata(folder.checkpoint());
        // Where anything else is the matter, it must not be replaced.
        let is_missing = newest.is_err_and(|error| error.kind() == ErrorKind::NotFound)
            && checkpoint::locate(path).is_err();
        let opened = if is_missing { None } else { Some(Opened::of(path)?) };
        Ok((folder, opened))
    }

    /// Whether nothing keeps other processes from writing to it, since its file system has no locks.
    #[must_use]
    pub fn is_unguarded(&self) -> bool {
        self.lock.as_ref().is_some_and(|lock| !lock.is_effective())
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where the checkpoint goes.
    #[must_use]
    pub fn checkpoint(&self) -> PathBuf {
        self.path.join(Self::CHECKPOINT)
    }

    /// The folder that the checkpoint is written to, wherever a link leads.
    ///
    /// # Errors
    /// When links lead in a circle.
    pub(super) fn of_checkpoint(&self) -> Result<PathBuf> {
        let file = behind_links(&self.checkpoint())?;
        Ok(file.parent().unwrap_or(&self.path).to_owned())
    }

    /// Where the page about the run goes.
    #[must_use]
    pub fn report(&self) -> PathBuf {
        self.path.join(Self::REPORT)
    }

    /// The log as it was left; empty where there is none.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn log(&self) -> Result<Log> {
        Log::read(&self.path.join(Self::LOG))
    }

    /// The resolved configuration as JSON; `None` where it cannot be read.
    #[must_use]
    pub fn config(&self) -> Option<String> {
        fs::read_to_string(self.path.join(Self::CONFIG)).ok()
    }

    /// Makes the folder again where it was removed, with the configuration; whether it was.
    ///
    /// # Errors
    /// When it cannot be made, or another process trains into one of that name.
    pub fn make_again(&mut self, config: &Config) -> Result<bool> {
        if self.lock.as_ref().is_none_or(FolderLock::is_in_place) {
            return Ok(false);
        }
        let lock = FolderLock::alone(&self.path)?;
        write_json(&self.path.join(Self::CONFIG), config)?;
        self.lock = Some(lock);
        Ok(true)
    }

    /// Replaces what an earlier run left, or goes on with it from step `resumed` on; the configuration is written, and
    /// the log open.
    ///
    /// # Errors
    /// When a file cannot be written or removed.
    pub fn begin(&self, config: &Config, resumed: Option<u32>) -> Result<LogWriter> {
        if resumed.is_none() {
            checkpoint::remove_earlier(&self.checkpoint()).context("removing an earlier checkpoint")?;
            for name in [Self::CHECKPOINT, Self::LOG, Self::CONFIG, Self::REPORT] {
                // A link stays, to be written through.
                remove(&behind_links(&self.path.join(name))?)?;
            }
        }
        write_json(&self.path.join(Self::CONFIG), config)?;
        let log = self.path.join(Self::LOG);
        match resumed {
            Some(step) => LogWriter::resume(&log, step),
            None => LogWriter::create(&log),
        }
    }
}

fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            Err(error).with_context(|| format!("removing {}", path.display()))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_run_replaces_an_earlier_one_only_when_asked() {
        let folder = tempfile::tempdir().expect("temporary folder");
        assert!(RunFolder::find(folder.path()).is_err() && RunFolder::to_resume(folder.path()).is_err());
        let run = RunFolder::unused(folder.path()).expect("empty");
        fs::write(run.report(), "earlier").expect("writable");
        fs::write(folder.path().join("notes.txt"), "kept").expect("writable");
        let in_use = RunFolder::to_overwrite(folder.path()).expect_err("another run has it");
        assert!(in_use.to_string().contains(&format!("process {} writes to it", std::process::id())));
        drop(run);
        let used = RunFolder::unused(folder.path()).expect_err("an earlier run was there");
        assert!(used.to_string().contains("is not empty"), "{used}");
        let mut run = RunFolder::to_overwrite(folder.path()).expect("a folder");
        run.begin(&Config::default(), None).expect("writable");
        assert!(!run.report().exists() && folder.path().join("notes.txt").exists());
        assert!(run.config().is_some_and(|text| text.contains("\"grid\"")));
        assert_eq!(RunFolder::find(&run.path.join(RunFolder::LOG)).expect("there").path, run.path);
        #[cfg(unix)]
        {
            let target = run.path.join("elsewhere");
            std::os::unix::fs::symlink("elsewhere", run.report()).expect("a link");
            fs::write(&target, "earlier").expect("writable");
            run.begin(&Config::default(), None).expect("writable");
            assert!(run.report().is_symlink() && !target.exists(), "what it leads to is replaced");
        }
        fs::remove_dir_all(&run.path).expect("removable");
        assert!(run.make_again(&Config::default()).expect("writable") && run.config().is_some());
        assert!(!run.make_again(&Config::default()).expect("writable"), "it is there");
        fs::write(run.path.join(RunFolder::LOG), "").expect("writable");
        assert!(RunFolder::unused(&run.path.join(RunFolder::LOG)).is_err(), "a file is no folder");
    }
}
