//! Locks on folders, by which processes keep out of one another's files. The system releases a lock when the process that
//! holds it ends, however it ends.

use super::file::writable_folder;
use super::temporary::{is_same, is_temporary, remove_leftovers};
use anyhow::{Context, Result};
use fs4::{FileExt, TryLockError};
use std::ffi::OsStr;
use std::fmt;
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

/// The name of the file that a process locks while it writes to a folder.
const LOCK: &str = ".nerf-lock";
/// The name of the file that it locks besides while it decides what becomes of the folder, or changes a list in it.
const TURN: &str = ".nerf-turn";

/// A folder that other processes do not write to meanwhile.
#[derive(Debug)]
pub struct FolderLock {
    folder: PathBuf,
    file: LockFile,
    /// Whether the folder was created for it.
    is_new: bool,
}

impl FolderLock {
    /// Locks a folder for this process alone, and creates it where there is none. What processes that have ended left half
    /// written in it is removed.
    ///
    /// # Errors
    /// [`InUse`] when another process has it, or files cannot be written to it.
    pub fn alone(folder: &Path) -> Result<Self> {
        Self::take(folder, FileExt::try_lock)
    }

    /// Locks a folder together with other processes that do so.
    ///
    /// # Errors
    /// As [`FolderLock::alone`].
    pub fn shared(folder: &Path) -> Result<Self> {
        Self::take(folder, FileExt::try_lock_shared)
    }

    fn take(folder: &Path, hold: fn(&File) -> Result<(), TryLockError>) -> Result<Self> {
        let is_new = !folder.exists();
        writable_folder(folder)?;
        let file = LockFile::take(&folder.join(LOCK), hold);
        let file = file.with_context(|| format!("locking the folder {}", folder.display()))?;
        let file = file.ok_or_else(|| InUse::of(folder))?;
        // Not before: a training keeps names of whole files meanwhile that nobody has locked.
        remove_leftovers(folder);
        Ok(Self { folder: folder.to_owned(), file, is_new })
    }

    /// From now on the folder is shared with others that do so.
    ///
    /// # Errors
    /// [`InUse`] when another process was faster.
    pub fn share(&self) -> Result<()> {
        let Some(file) = &self.file.file else { return Ok(()) };
        Ok(FileExt::try_lock_shared(file).map_err(|_| InUse::of(&self.folder))?)
    }

    /// Whether the file system has locks; if not, nothing keeps other processes out.
    #[must_use]
    pub fn is_effective(&self) -> bool {
        self.file.file.is_some()
    }

    /// Whether the folder is still there and locked.
    #[must_use]
    pub fn is_in_place(&self) -> bool {
        self.file.file.as_ref().map_or(self.folder.is_dir(), |file| is_same(file, &self.file.path))
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        self.file.remove();
        if self.is_new {
            // Only where nothing was written to it.
            let _ = std::fs::remove_dir(&self.folder);
        }
    }
}

/// Whether there is anything in a folder but locks and what was left half written. A folder that is not there holds nothing.
///
/// # Errors
/// When it is no folder, or cannot be read.
pub fn is_used(folder: &Path) -> Result<bool> {
    let is_ours = |name: &OsStr| name == LOCK || name == TURN || is_temporary(name);
    match std::fs::read_dir(folder) {
        Ok(entries) => Ok(entries.flatten().any(|entry| !is_ours(&entry.file_name()))),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error).with_context(|| format!("{} cannot be used as a folder", folder.display())),
    }
}

/// Runs `work` while no other process does so for this folder, which must be there.
///
/// # Errors
/// When the folder cannot be written to, and those of `work`.
pub fn one_at_a_time<T>(folder: &Path, work: impl FnOnce() -> Result<T>) -> Result<T> {
    let wait = |file: &File| loop {
        match FileExt::lock(file) {
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            done => return done.map_err(TryLockError::Error),
        }
    };
    let lock = LockFile::take(&folder.join(TURN), wait);
    let lock = lock.with_context(|| format!("the folder {} cannot be written to", folder.display()))?;
    let result = work();
    lock.inspect(LockFile::remove);
    result
}

/// A locked file with the number of the process that holds it.
#[derive(Debug)]
struct LockFile {
    path: PathBuf,
    /// `None` where the file system has no locks.
    file: Option<File>,
}

impl LockFile {
    /// `None` where another process holds the lock.
    fn take(path: &Path, hold: impl Fn(&File) -> Result<(), TryLockError>) -> std::io::Result<Option<Self>> {
        let path = path.to_owned();
        loop {
            let options =
                || OpenOptions::new().create(true).truncate(false).read(true).write(true).open(&path);
            let mut file = options()?;
            match hold(&file) {
                // Who had it before may have removed it.
                Ok(()) if !is_same(&file, &path) => {}
                Ok(()) => {
                    file.set_len(0)?;
                    // On a full disk it is only not known who holds it.
                    let _ = write!(file, "{}", std::process::id());
                    return Ok(Some(Self { path, file: Some(file) }));
                }
                Err(TryLockError::WouldBlock) => return Ok(None),
                Err(TryLockError::Error(_)) => return Ok(Some(Self { path, file: None })),
            }
        }
    }

    /// Removes the file, unless another process shares the lock.
    fn remove(&self) {
        let is_last = self
            .file
            .as_ref()
            .is_none_or(|file| FileExt::try_lock(file).is_ok() && is_same(file, &self.path));
        if is_last {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Why a folder cannot be written to now: another process has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InUse {
    folder: PathBuf,
    process: Option<u32>,
}

impl InUse {
    fn of(folder: &Path) -> Self {
        let text = std::fs::read_to_string(folder.join(LOCK)).ok();
        Self { folder: folder.to_owned(), process: text.and_then(|text| text.trim().parse().ok()) }
    }
}

impl fmt::Display for InUse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the folder {} is in use: ", self.folder.display())?;
        match self.process {
            Some(process) => write!(f, "process {process} writes to it")?,
            None => f.write_str("another process writes to it")?,
        }
        f.write_str("; wait until it has ended, end it, or name another folder")
    }
}

impl std::error::Error for InUse {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_folder_has_one_owner_until_it_is_let_go() {
        let place = tempfile::tempdir().expect("temporary folder");
        let folder = place.path().join("run");
        let lock = FolderLock::alone(&folder).expect("nobody has it");
        assert!(lock.is_effective() && lock.is_in_place());
        let error = FolderLock::alone(&folder).expect_err("it has an owner");
        let in_use = error.downcast_ref::<InUse>().expect("in use");
        assert_eq!(in_use.process, Some(std::process::id()));
        fs::write(folder.join(".nerf-d4e5f6.part"), "the owner's").expect("writable");
        assert!(FolderLock::shared(&folder).is_err());
        fs::remove_file(folder.join(".nerf-d4e5f6.part")).expect("not removed by who was refused");
        drop(lock);
        assert!(!folder.exists(), "nothing was written to it");
        assert!(!is_used(&folder).expect("nothing"));
        let both =
            [FolderLock::shared(&folder), FolderLock::shared(&folder)].map(|lock| lock.expect("shared"));
        assert!(FolderLock::alone(&folder).is_err());
        fs::write(folder.join(".nerf-a1b2c3.part"), "half of a file").expect("writable");
        assert!(!is_used(&folder).expect("a folder"));
        fs::write(folder.join("result"), "kept").expect("writable");
        assert!(is_used(&folder).expect("a folder") && is_used(&folder.join("result")).is_err());
        let turn = one_at_a_time(&folder, || Ok(fs::read_to_string(folder.join(TURN))?));
        assert_eq!(turn.expect("writable"), std::process::id().to_string());
        drop(both);
        let mut names: Vec<_> =
            fs::read_dir(&folder).expect("kept").map(|entry| entry.expect("readable").file_name()).collect();
        names.sort();
        assert_eq!(names, [".nerf-a1b2c3.part", "result"], "no lock stays");
    }

    #[test]
    fn a_removed_folder_is_noticed() {
        let place = tempfile::tempdir().expect("temporary folder");
        let folder = place.path().join("run");
        let first = FolderLock::alone(&folder).expect("nobody has it");
        fs::remove_dir_all(&folder).expect("removable");
        assert!(!first.is_in_place());
        let second = FolderLock::alone(&folder).expect("nobody has it any more");
        assert!(!first.is_in_place() && second.is_in_place());
        drop(first);
        assert!(second.is_in_place(), "what another process locks is not removed");
    }
}
