//! Temporary files, which their processes lock, so that others know whose are left behind.

use anyhow::Result;
use fs4::{FileExt, TryLockError};
use std::ffi::OsStr;
use std::fs::File;
use std::io::{Error, ErrorKind};
use std::path::Path;
use tempfile::NamedTempFile;

/// How the names of temporary files begin and end.
const NAME: [&str; 2] = [".nerf-", ".part"];

/// A locked file of a new name. No other opening of it may write to it on systems whose locks are mandatory.
///
/// # Errors
/// When it cannot be created. The error does not name it, which would say nothing to anybody.
pub(super) fn temporary_in(folder: &Path) -> Result<NamedTempFile> {
    if !folder.is_dir() {
        let missing = format!("the folder {} does not exist", folder.display());
        return Err(Error::new(ErrorKind::NotFound, missing).into());
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(NAME[0]).suffix(NAME[1]);
    // Temporary files are private by default; results get the permissions any new file would get.
    #[cfg(unix)]
    let permissions: std::fs::Permissions = std::os::unix::fs::PermissionsExt::from_mode(0o666);
    #[cfg(unix)]
    builder.permissions(permissions);
    let reason = |error: Error| {
        let cause = error.get_ref().and_then(|named| named.source()?.downcast_ref::<Error>()?.raw_os_error());
        let cause = cause.map_or_else(|| error.kind().into(), Error::from_raw_os_error);
        anyhow::Error::new(cause).context(format!("cannot create a file in {}", folder.display()))
    };
    loop {
        let temporary = builder.tempfile_in(folder).map_err(reason)?;
        let lock = FileExt::try_lock(temporary.as_file());
        // Before it was locked, another process may have taken it for a leftover.
        let is_taken = matches!(lock, Err(TryLockError::WouldBlock));
        if !is_taken && is_same(temporary.as_file(), temporary.path()) {
            return Ok(temporary);
        }
    }
}

/// Removes the temporary files of processes that have ended; a living one holds a lock on its own.
pub fn remove_leftovers(folder: &Path) {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    for entry in entries.filter(|entry| is_temporary(&entry.file_name())) {
        let file = File::options().write(true).open(entry.path());
        if file.is_ok_and(|file| FileExt::try_lock(&file).is_ok()) {
            // Whoever cannot remove it is not hindered by it either.
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// Whether a file of this name is a temporary one.
pub(super) fn is_temporary(name: &OsStr) -> bool {
    let [begin, end] = NAME;
    name.to_str().is_some_and(|name| name.starts_with(begin) && name.ends_with(end))
}

/// Whether an open file is what is at `path`.
#[cfg(unix)]
pub fn is_same(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |data: std::fs::Metadata| (data.dev(), data.ino());
    let [open, there] = [file.metadata(), std::fs::metadata(path)].map(|data| data.map(identity).ok());
    open.is_some() && open == there
}

/// Whether an open file is what is at `path`: elsewhere one that is open is not replaced.
#[cfg(not(unix))]
pub fn is_same(_: &File, path: &Path) -> bool {
    path.exists()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn leftovers_of_dead_processes_are_removed_and_those_of_living_ones_are_not() {
        let folder = tempfile::tempdir().expect("temporary folder");
        fs::write(folder.path().join(".nerf-a1b2c3.part"), "half of a").expect("writable");
        fs::write(folder.path().join("mine.part"), "kept").expect("writable");
        let living = temporary_in(folder.path()).expect("writable");
        remove_leftovers(folder.path());
        let mut left: Vec<_> = fs::read_dir(folder.path())
            .expect("readable")
            .map(|entry| entry.expect("readable").path())
            .collect();
        left.sort();
        assert_eq!(left, [living.path(), &folder.path().join("mine.part")]);
        assert!(is_same(living.as_file(), living.path()) && !is_same(living.as_file(), &left[1]));
    }
}
