//! Writing files so that a crash never leaves half of one.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use super::temporary::{remove_leftovers, temporary_in};
use anyhow::{Context, Result};
use serde::Serialize;

/// Writes a file through `write` under a temporary name in the same folder, syncs it to disk and renames
/// it to `path`: readers see the old file or the complete new one.
pub fn write_atomically(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> Result<()>) -> Result<()> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let attempt = || -> Result<()> {
        let temporary = temporary_in(folder)?;
        // Not opened again: some systems let no other opening write to a locked file.
        let mut writer = BufWriter::new(temporary.as_file().try_clone()?);
        write(&mut writer)?;
        writer.flush()?;
        writer.get_ref().sync_all()?;
        drop(writer);
        // Its own error tells the cause in its text and as its cause.
        temporary.persist(path).map_err(|failed| failed.error)?;
        Ok(())
    };
    attempt().with_context(|| format!("writing {}", path.display()))
}

/// Writes an object as an indented JSON file.
///
/// # Errors
/// As [`write_atomically`].
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    write_atomically(path, |file| {
        serde_json::to_writer_pretty(&mut *file, value)?;
        Ok(file.write_all(b"\n")?)
    })
}

/// Creates the folder where there is none, and tries whether files can be written to it. What processes that have ended left
/// half written in it is removed.
pub fn writable_folder(path: &Path) -> Result<()> {
    let show = path.display();
    std::fs::create_dir_all(path).with_context(|| format!("creating the folder {show}"))?;
    temporary_in(path).with_context(|| format!("the folder {show} cannot be written to"))?;
    remove_leftovers(path);
    Ok(())
}

/// Bytes that can still be written to a folder's file system; `None` where the system does not say.
#[must_use]
pub fn available_bytes(folder: &Path) -> Option<u64> {
    fs4::statvfs(folder).ok().filter(|stats| stats.total_space() > 0).map(|stats| stats.available_space())
}

/// The first of some files that are there and lie in `folder` itself, whichever way folder and files are spelled or linked.
pub fn first_within(folder: &Path, files: impl IntoIterator<Item = PathBuf>) -> Option<PathBuf> {
    let folder = folder.canonicalize().ok()?;
    let mut is_within = HashMap::new();
    files.into_iter().find(|file| {
        let parent = file.parent().unwrap_or(Path::new("")).to_owned();
        let by_name =
            |parent: &PathBuf| Path::new(".").join(parent).canonicalize().is_ok_and(|it| it == folder);
        let there = *is_within.entry(parent).or_insert_with_key(by_name);
        // A link elsewhere to a file in the folder.
        let linked = || file.is_symlink() && file.canonicalize().is_ok_and(|it| it.parent() == Some(&folder));
        (there || linked()) && file.exists()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_name_no_temporary_file() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("nowhere/out.txt");
        let error = write_atomically(&path, |_| Ok(())).expect_err("there is no such folder");
        let error = format!("{error:#}");
        assert!(error.ends_with("nowhere does not exist") && !error.contains(".nerf-"), "{error}");
    }

    #[test]
    fn replaces_the_file_or_leaves_it_alone() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("out.txt");
        write_atomically(&path, |w| Ok(w.write_all(b"first")?)).expect("writable");
        let failed = write_atomically(&path, |w| {
            w.write_all(b"half of the sec")?;
            anyhow::bail!("disk on fire")
        });
        assert!(format!("{:#}", failed.expect_err("fails")).contains("out.txt: disk on fire"));
        assert_eq!(std::fs::read(&path).expect("readable"), b"first");
        let left = std::fs::read_dir(folder.path()).expect("readable").count();
        assert_eq!(left, 1, "no temporary file may stay");
    }
}
