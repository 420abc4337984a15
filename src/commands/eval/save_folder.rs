//! The folder that renderings of photos are saved to: those of one field, and of one dataset.

use anyhow::{Context, Result, bail, ensure};
use nerf::support::file::write_json;
use nerf::support::lock::{FolderLock, one_at_a_time};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The file that tells what is rendered.
const LISTING: &str = "renderings.json";

/// What all renderings in a folder have in common, and what is said where that differs.
const IN_COMMON: [(&str, &str); 4] = [
    ("field", "another field"),
    ("dataset", "another dataset, or its photos read otherwise"),
    ("background", "another background"),
    ("spp", "another number of samples per pixel"),
];

/// A folder that renderings are saved to.
#[derive(Debug)]
pub(super) struct SaveFolder {
    /// One for each.
    pub(super) files: Vec<PathBuf>,
    _lock: FolderLock,
}

impl SaveFolder {
    /// Takes a folder for `files` in it, for which `lock` holds it. What `rendering` says is what all of them have in common,
    /// those of earlier ones included; with `overwrite` those are removed where they have not.
    ///
    /// # Errors
    /// When the folder has renderings of something else, or cannot be written to.
    pub(super) fn take(
        (folder, lock): (&Path, FolderLock),
        files: Vec<PathBuf>,
        rendering: Map<String, Value>,
        overwrite: bool,
    ) -> Result<Self> {
        one_at_a_time(folder, || {
            let mut names = earlier(folder, &files, &rendering, overwrite)?;
            let name = |file: &PathBuf| Some(file.file_name()?.to_string_lossy().into_owned());
            names.extend(files.iter().filter_map(name));
            let mut listing = rendering;
            listing.insert("files".to_owned(), json!(names));
            write_json(&folder.join(LISTING), &listing)
        })?;
        // From now on others may save more of the same.
        lock.share()?;
        Ok(Self { files, _lock: lock })
    }
}

/// Names of the files that are there and stay; what does not is removed.
fn earlier(
    folder: &Path,
    files: &[PathBuf],
    rendering: &Map<String, Value>,
    overwrite: bool,
) -> Result<BTreeSet<String>> {
    let show = folder.display();
    let Some(listing) = read(folder, overwrite)? else {
        let replaced = files.iter().find(|file| !overwrite && file.exists());
        ensure!(
            replaced.is_none(),
            "nothing in {show} tells of which field its pictures are, and {} would be replaced; name another folder, or add \
             --overwrite",
            replaced.cloned().unwrap_or_default().display()
        );
        return Ok(BTreeSet::new());
    };
    let names = listing.get("files").and_then(Value::as_array).into_iter().flatten();
    let names: BTreeSet<String> = names.filter_map(|name| Some(name.as_str()?.to_owned())).collect();
    let differs = |(key, _): &&(&str, &str)| listing.get(*key) != rendering.get(*key);
    let told: Vec<&str> = IN_COMMON.iter().filter(differs).map(|(_, what)| *what).collect();
    if told.is_empty() {
        return Ok(names);
    }
    let text =
        |key| listing.get(key).map_or("unknown".to_owned(), |value| value.to_string().replace('"', ""));
    ensure!(
        overwrite,
        "the renderings in {show}, of step {} of {}, must not be mixed with these, of {}; name another folder, or add \
         --overwrite to replace them",
        text("step"),
        text("checkpoint"),
        told.join(", ")
    );
    let is_picture = |name: &&String| Path::new(name).file_name().is_some_and(|bare| bare == name.as_str());
    for picture in names.iter().filter(is_picture).map(|name| folder.join(name)) {
        match fs::remove_file(&picture) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                bail!("removing {}: {error}", picture.display())
            }
            _ => {}
        }
    }
    Ok(BTreeSet::new())
}

/// What a folder says of its renderings, if it does; what cannot be read says nothing with `overwrite`.
fn read(folder: &Path, overwrite: bool) -> Result<Option<Map<String, Value>>> {
    let path = folder.join(LISTING);
    let text = match fs::read_to_string(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        text => text.with_context(|| format!("reading {}", path.display()))?,
    };
    match serde_json::from_str(&text) {
        Err(_) if overwrite => Ok(None),
        listing => listing.with_context(|| {
            format!(
                "reading {}; name another folder, or add --overwrite to replace its renderings",
                path.display()
            )
        }),
    }
}
