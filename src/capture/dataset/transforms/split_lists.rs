//! Lists of file names per split, in the file itself.

use std::collections::HashMap;

use anyhow::{Result, bail, ensure};
use serde_json::Value;

use super::FrameEntry;
use crate::capture::dataset::json::{Fields, REMEDY, describe, shortened};
use crate::capture::dataset::notes::Notes;
use crate::photo::Split;

/// The lists of nerfstudio, in rising priority for a frame that several of them name.
const KEYS: [(Split, &str); 3] =
    [(Split::Train, "train_filenames"), (Split::Val, "val_filenames"), (Split::Test, "test_filenames")];

/// Folders that a listed name may have in front of what the frames call the file.
const DEEPEST: usize = 32;

/// Puts the frames that the lists name into their splits.
pub(super) fn assign(file: Fields, entries: &mut [FrameEntry], notes: &mut Notes) -> Result<()> {
    let names = Names::of(entries);
    let (mut listed, mut unknown, mut moved) = (0, Vec::new(), 0);
    for (split, key) in KEYS {
        for name in file.list(key)?.unwrap_or_default() {
            let Value::String(name) = name else {
                bail!("`{key}` must list file names, found {}; {REMEDY}", describe(name));
            };
            listed += 1;
            let Some(found) = names.find(name) else {
                unknown.push(name);
                continue;
            };
            for &index in found {
                let before = entries[index].split.replace(split);
                moved += usize::from(before.is_some_and(|before| before != split));
            }
        }
    }
    ensure!(
        listed == 0 || unknown.len() < listed,
        "none of the frames is named in `train_filenames`, `val_filenames`, `test_filenames`: a list has {:?}, \
         the first frame is {:?}; list the frames' own `file_path`",
        unknown.first().map_or(String::new(), |name| shortened(name)),
        entries.first().map_or(String::new(), |entry| shortened(&entry.file_path))
    );
    if let Some(first) = unknown.first() {
        notes.warn(format!(
            "names in the split lists that no frame has: {} of {listed}, beginning with {:?}",
            unknown.len(),
            shortened(first)
        ));
    }
    if moved > 0 {
        notes
            .warn(format!("frames named in several split lists: {moved}; test goes before val before train"));
    }
    let left = entries.iter().filter(|entry| entry.split.is_none()).count();
    if listed > 0 && left > 0 {
        notes.note(format!("frames in no split list: {left}; they are not used"));
    }
    Ok(())
}

/// Finds frames by their names, by the names without extension, and by the ends of either.
struct Names {
    whole: HashMap<String, Vec<usize>>,
    /// By the last part of the path alone; `None` where frames of several folders have it.
    last: HashMap<String, Option<Vec<usize>>>,
}

impl Names {
    fn of(entries: &[FrameEntry]) -> Self {
        let mut names = Self { whole: HashMap::new(), last: HashMap::new() };
        for (index, entry) in entries.iter().enumerate() {
            let path = normal(&entry.file_path);
            for name in spellings(&path) {
                names.whole.entry(name.to_owned()).or_default().push(index);
            }
        }
        for (path, indices) in &names.whole {
            let last = path.rsplit('/').next().unwrap_or(path);
            let known = names.last.entry(last.to_owned());
            known.and_modify(|known| *known = None).or_insert_with(|| Some(indices.clone()));
        }
        names
    }

    fn find(&self, listed: &str) -> Option<&[usize]> {
        let path = normal(listed);
        let starts = path.match_indices('/').map(|(at, _)| at + 1);
        for start in std::iter::once(0).chain(starts.take(DEEPEST)) {
            let tail = &path[start..];
            if let Some(found) = spellings(tail).find_map(|name| self.whole.get(name)) {
                return Some(found);
            }
        }
        let last = path.rsplit('/').next().unwrap_or(&path);
        spellings(last).find_map(|name| self.last.get(name)?.as_deref())
    }
}

/// A path as written and without its extension.
fn spellings(path: &str) -> impl Iterator<Item = &str> {
    let stem = path.rsplit_once('.').map(|(stem, _)| stem);
    std::iter::once(path).chain(stem.filter(|stem| !stem.is_empty() && !stem.ends_with('/')))
}

/// A path without the parts that mean nothing, with forward slashes.
fn normal(path: &str) -> String {
    let path = path.trim().replace('\\', "/");
    let parts: Vec<_> = path.split('/').filter(|part| !matches!(*part, "" | ".")).collect();
    parts.join("/")
}
