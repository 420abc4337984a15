//! The checkpoints before the newest one, which lie beside it as `checkpoint-STEP.safetensors`: what is there while the
//! newest is replaced, and where it turns out to be damaged.

use super::{Checkpoint, FILE, OtherVersion};
use crate::support::file::behind_links;
use crate::support::remedy::{Advised, Remedy};
use anyhow::{Error, Result, bail, ensure};
use std::cmp::Reverse;
use std::ffi::OsStr;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use tempfile::TempPath;

/// A checkpoint, and the file that it was read from.
#[derive(Debug)]
pub struct Opened {
    /// What was read.
    pub checkpoint: Checkpoint,
    /// The file.
    pub path: PathBuf,
    /// Why a newer one was not.
    pub damage: Option<Error>,
}

impl Opened {
    /// Reads the checkpoint that `path`, the folder of a run or a file, stands for: the newest in a folder that can be used.
    ///
    /// # Errors
    /// When there is none, or the newest cannot be used and none before it.
    pub fn of(path: &Path) -> Result<Self> {
        let newest = locate(path)?;
        let damage = match Checkpoint::load(&newest) {
            Ok(checkpoint) => return Ok(Self { checkpoint, path: newest, damage: None }),
            Err(error) if newest == path || error.is::<OtherVersion>() => return Err(error),
            Err(error) => error,
        };
        for (_, path) in earlier(&newest) {
            if let Ok(checkpoint) = Checkpoint::load(&path) {
                return Ok(Self { checkpoint, path, damage: Some(damage) });
            }
        }
        Err(damage)
    }

    /// That an earlier checkpoint was read and why, as a sentence without a full stop.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        let damage = self.damage.as_ref()?;
        let (path, step) = (self.path.display(), self.checkpoint.metadata.step);
        Some(format!("{damage:#}; the one before is used, {path} of step {step}"))
    }
}

/// The newest checkpoint's file: of a run's folder, which may be lost where there are earlier ones, or the file itself.
///
/// # Errors
/// When there is none; the message says what was expected.
pub fn locate(path: &Path) -> Result<PathBuf> {
    let name = path.display();
    let expected = |found: String| Advised::new(found, Remedy::RunFolder, ", or a checkpoint in it");
    if path.is_dir() {
        let file = path.join(FILE);
        let is_there = file.is_file() || !earlier(&file).is_empty();
        ensure!(is_there, expected(format!("the folder {name} has no {FILE}; expected ")));
        return Ok(file);
    }
    if !path.exists() {
        bail!(expected(format!("{name} does not exist; expected ")));
    }
    Ok(path.to_owned())
}

/// Lets `save` replace the newest checkpoint by one of `step`. What it was is kept as an earlier one, if it is whole and of
/// an earlier step; of all checkpoints at most `keep` stay.
///
/// # Errors
/// Those of `save`; the files are as they were then.
pub fn replace(newest: &Path, step: u32, keep: usize, save: impl FnOnce() -> Result<()>) -> Result<()> {
    let newest = target(newest);
    let held = if keep > 1 { hold(&newest).filter(|(before, _)| *before < step) } else { None };
    save()?;
    // The new one is whole: what becomes of those before it is no reason to fail.
    if let Some((before, link)) = held {
        let _ = link.persist(named(&newest, before));
    }
    let is_left = |(number, before): (usize, u32)| before < step && number + 1 < keep;
    for (number, (before, path)) in earlier(&newest).into_iter().enumerate() {
        if !is_left((number, before)) {
            let _ = fs::remove_file(path);
        }
    }
    Ok(())
}

/// Removes all checkpoints but the newest.
///
/// # Errors
/// When one cannot be removed.
pub fn remove_earlier(newest: &Path) -> io::Result<()> {
    earlier(newest).into_iter().try_for_each(|(_, path)| fs::remove_file(path))
}

/// A second name for the file until it has its own, and the step that it is of; `None` if it is not there or damaged. It is
/// copied where the file system knows no second names.
fn hold(newest: &Path) -> Option<(u32, TempPath)> {
    let step = Checkpoint::check(newest).ok()?.step;
    let link = |path: &Path| match fs::hard_link(newest, path) {
        Err(error) if error.kind() != ErrorKind::AlreadyExists => fs::copy(newest, path).map(|_| ()),
        done => done,
    };
    let mut builder = tempfile::Builder::new();
    let link = builder.prefix(".nerf-").suffix(".part").make_in(newest.parent()?, link);
    Some((step, link.ok()?.into_temp_path()))
}

/// The checkpoints beside `newest` with their steps, the latest first.
fn earlier(newest: &Path) -> Vec<(u32, PathBuf)> {
    let newest = target(newest);
    let Some(entries) = newest.parent().and_then(|folder| fs::read_dir(folder).ok()) else {
        return Vec::new();
    };
    let numbered = |path: PathBuf| {
        let name = path.file_stem()?.to_str()?;
        let step = name.strip_prefix(newest.file_stem()?.to_str()?)?.strip_prefix('-')?.parse().ok()?;
        (path.extension() == newest.extension() && path.is_file()).then_some((step, path))
    };
    let mut found: Vec<_> = entries.flatten().filter_map(|entry| numbered(entry.path())).collect();
    found.sort_by_key(|(step, _)| Reverse(*step));
    found
}

/// The name of an earlier checkpoint.
fn named(newest: &Path, step: u32) -> PathBuf {
    let part = |part: Option<&OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    newest.with_file_name(format!("{}-{step}.{}", part(newest.file_stem()), part(newest.extension())))
}

/// The file that `path` leads to, with its folder.
fn target(path: &Path) -> PathBuf {
    let path = behind_links(path).unwrap_or_else(|_| path.to_owned());
    match path.parent() {
        Some(folder) if folder.as_os_str().is_empty() => Path::new(".").join(path),
        _ => path,
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::checkpoint;
    use super::*;

    fn save(newest: &Path, step: u32, keep: usize) {
        let mut of_step = checkpoint();
        (of_step.metadata.step, of_step.state.step) = (step, step);
        replace(newest, step, keep, || of_step.save(newest)).expect("saved");
    }

    fn steps(newest: &Path) -> Vec<u32> {
        earlier(newest).into_iter().map(|(step, _)| step).collect()
    }

    fn damage(path: &Path) {
        let mut bytes = fs::read(path).expect("readable");
        let middle = bytes.len() / 2;
        bytes[middle] ^= 4;
        fs::write(path, bytes).expect("writable");
    }

    #[test]
    fn those_before_the_newest_are_kept_and_used_where_it_is_damaged() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let newest = folder.path().join(FILE);
        let opened = || Opened::of(folder.path());
        (1..=5).for_each(|step| save(&newest, step * 9, 3));
        assert_eq!(steps(&newest), [36, 27]);
        assert!(opened().expect("whole").damage.is_none());
        damage(&newest);
        let found = opened().expect("an earlier one");
        assert_eq!((found.checkpoint.state.step, &found.path), (36, &named(&newest, 36)));
        let warning = found.warning().expect("said");
        assert!(
            warning.contains("the tensor '") && warning.ends_with("-36.safetensors of step 36"),
            "{warning}"
        );
        assert!(Opened::of(&newest).is_err(), "this file and no other");
        // What is damaged is not kept, and neither is what comes again.
        save(&newest, 30, 3);
        assert_eq!(steps(&newest), [27]);
        fs::remove_file(&newest).expect("removable");
        assert_eq!(opened().expect("an earlier one").checkpoint.state.step, 27);
        damage(&named(&newest, 27));
        assert!(opened().is_err());
        save(&newest, 40, 1);
        assert!(steps(&newest).is_empty());
        save(&newest, 41, 2);
        remove_earlier(&newest).expect("removable");
        assert_eq!(fs::read_dir(folder.path()).expect("readable").count(), 1);
    }

    #[test]
    fn a_failed_save_changes_nothing() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let newest = folder.path().join(FILE);
        (1..=2).for_each(|step| save(&newest, step, 2));
        assert!(replace(&newest, 3, 2, || bail!("the disk is full")).is_err());
        assert_eq!(steps(&newest), [1]);
        assert_eq!(Opened::of(folder.path()).expect("whole").checkpoint.state.step, 2);
        assert_eq!(fs::read_dir(folder.path()).expect("readable").count(), 2);
        let mut newer = checkpoint();
        newer.metadata.format += 1;
        newer.save(&newest).expect("writable");
        assert!(Opened::of(folder.path()).is_err_and(|error| error.is::<OtherVersion>()), "not damaged");
    }

    #[cfg(unix)]
    #[test]
    fn earlier_ones_lie_beside_what_a_link_leads_to() {
        let [folder, elsewhere] = [(); 2].map(|()| tempfile::tempdir().expect("temporary folder"));
        let (newest, place) = (folder.path().join(FILE), elsewhere.path().join("field.safetensors"));
        checkpoint().save(&place).expect("writable");
        std::os::unix::fs::symlink(&place, &newest).expect("a link");
        replace(&newest, 20, 2, || checkpoint().save(&newest)).expect("saved");
        assert_eq!(earlier(&newest), [(12, named(&place, 12))]);
        damage(&place);
        assert_eq!(Opened::of(folder.path()).expect("an earlier one").checkpoint, checkpoint());
    }
}
