//! Writing files so that a crash never leaves half of one.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::temporary::temporary_in;
use anyhow::{Context, Result, bail};
use serde::Serialize;

/// Most links from one to the next before a file.
const MOST_LINKS: usize = 40;

/// A file that keeps why it could not be written: encoders tell that in words of their own.
#[derive(Debug)]
pub struct OutputFile {
    file: File,
    failure: Option<io::Error>,
}

/// Writes a file through `write` under a temporary name in the same folder, syncs it to disk and renames
/// it to `path`: readers see the old file or the complete new one. A link stays, and what it leads to is written.
///
/// # Errors
/// When the file cannot be written, whose cause is the [`io::Error`], or `write` fails.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<OutputFile>) -> Result<()>,
) -> Result<()> {
    let attempt = || -> Result<()> {
        let path = behind_links(path)?;
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let temporary = temporary_in(folder)?;
        // Not opened again: some systems let no other opening write to a locked file.
        let file = temporary.as_file().try_clone()?;
        let mut writer = BufWriter::new(OutputFile { file, failure: None });
        let written = write(&mut writer).and_then(|()| Ok(writer.flush()?));
        let (OutputFile { file, failure }, _) = writer.into_parts();
        failure.map_or(written, |failure| Err(failure.into()))?;
        file.sync_all()?;
        drop(file);
        // Its own error tells the cause in its text and as its cause.
        temporary.persist(&path).map_err(|failed| failed.error)?;
        Ok(())
    };
    attempt().with_context(|| format!("writing {}", path.display()))
}

/// The file that `path` leads to, over any links, whether it is there or not; a path that is no link is itself.
///
/// # Errors
/// When links lead in a circle.
pub fn behind_links(path: &Path) -> Result<PathBuf> {
    let mut end = path.to_owned();
    for _ in 0..MOST_LINKS {
        let Ok(target) = std::fs::read_link(&end) else { return Ok(end) };
        end = end.parent().unwrap_or(Path::new("")).join(target);
    }
    bail!("the links behind {} lead in a circle", path.display())
}

impl OutputFile {
    /// The outcome of an operation on the file, whose failure is kept.
    fn keep<T>(&mut self, outcome: io::Result<T>) -> io::Result<T> {
        outcome.map_err(|error| {
            let told = error.raw_os_error().map_or(error.kind().into(), io::Error::from_raw_os_error);
            if error.kind() != io::ErrorKind::Interrupted {
                self.failure.get_or_insert(error);
            }
            told
        })
    }
}

impl Write for OutputFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let outcome = self.file.write(bytes);
        self.keep(outcome)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for OutputFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let outcome = self.file.seek(to);
        self.keep(outcome)
    }
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

/// Creates the folder where there is none, and tries whether files can be written to it.
pub fn writable_folder(path: &Path) -> Result<()> {
    let show = path.display();
    std::fs::create_dir_all(path).with_context(|| format!("creating the folder {show}"))?;
    temporary_in(path).with_context(|| format!("the folder {show} cannot be written to"))?;
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

    #[test]
    fn a_failure_is_kept_that_an_encoder_hides() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("read-only");
        std::fs::write(&path, "").expect("writable");
        let mut file = OutputFile { file: File::open(&path).expect("there"), failure: None };
        let told = file.write(b"x").expect_err("it was opened to be read");
        let kept = file.failure.expect("kept");
        assert_eq!((told.kind(), told.raw_os_error()), (kept.kind(), kept.raw_os_error()));
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_and_are_written_through() {
        use std::os::unix::fs::symlink;
        let (near, far) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
        let (link, target) = (near.path().join("link"), far.path().join("target"));
        symlink(&target, &link).expect("a link");
        let relative = near.path().join("relative");
        symlink("link", &relative).expect("a link");
        for (path, text) in [(&link, "dangling"), (&link, "there"), (&relative, "by two")] {
            write_atomically(path, |w| Ok(w.write_all(text.as_bytes())?)).expect("writable");
            assert_eq!(std::fs::read_to_string(&target).expect("readable"), text);
        }
        assert!(link.is_symlink() && relative.is_symlink() && !target.is_symlink());
        let circle = near.path().join("circle");
        symlink("circle", &circle).expect("a link");
        let error = write_atomically(&circle, |_| Ok(())).expect_err("nowhere");
        assert!(format!("{error:#}").contains("lead in a circle"));
    }
}
