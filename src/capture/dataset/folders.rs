//! The folders of a dataset, each read once: which names are in them, and which are like another name.

use std::cell::OnceCell;
use std::collections::{HashMap, HashSet};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::file_names::{Likeness, extensions, is_picture, natural_order};

/// More folders of like names than this are not looked into for one path.
const MOST_FOLDERS: usize = 16;

/// What was read of folders so far.
#[derive(Default)]
pub(super) struct Folders {
    read: HashMap<PathBuf, Rc<Folder>>,
}

/// The names in one folder.
struct Folder {
    names: HashSet<OsString>,
    /// Names by what the least alike ones still have in common.
    alike: OnceCell<HashMap<String, Vec<OsString>>>,
}

impl Folder {
    fn read(path: &Path) -> Self {
        let shown = if path.as_os_str().is_empty() { Path::new(".") } else { path };
        let entries = std::fs::read_dir(shown).into_iter().flatten().flatten();
        Self { names: entries.map(|entry| entry.file_name()).collect(), alike: OnceCell::new() }
    }

    /// The names that are as like `name` as `likeness` asks, in order.
    fn alike(&self, name: &str, likeness: Likeness) -> Vec<&OsStr> {
        if likeness == Likeness::Same {
            return self.names.get(OsStr::new(name)).map(OsString::as_os_str).into_iter().collect();
        }
        let groups = self.alike.get_or_init(|| {
            let mut groups: HashMap<String, Vec<OsString>> = HashMap::new();
            for name in &self.names {
                let key = Likeness::Extension.key(&name.to_string_lossy()).into_owned();
                groups.entry(key).or_default().push(name.clone());
            }
            groups.values_mut().for_each(|names| names.sort());
            groups
        });
        let group = groups.get(Likeness::Extension.key(name).as_ref()).into_iter().flatten();
        let key = likeness.key(name);
        group.filter(|found| likeness.key(&found.to_string_lossy()) == key).map(OsString::as_os_str).collect()
    }
}

impl Folders {
    fn folder(&mut self, path: &Path) -> Rc<Folder> {
        if let Some(folder) = self.read.get(path) {
            return Rc::clone(folder);
        }
        let folder = Rc::new(Folder::read(path));
        self.read.insert(path.to_owned(), Rc::clone(&folder));
        folder
    }

    /// Whether there is something of this name.
    pub(super) fn has(&mut self, path: &Path) -> bool {
        let (Some(parent), Some(name)) = (path.parent(), path.file_name()) else { return false };
        self.folder(parent).names.contains(name)
    }

    /// The folder in `root`, or root itself, that has the most pictures, with their names in natural order.
    pub(super) fn pictures(&mut self, root: &Path) -> Option<(PathBuf, Vec<String>)> {
        let inner = std::fs::read_dir(root).into_iter().flatten().flatten().map(|entry| entry.path());
        let folders = std::iter::once(root.to_owned()).chain(inner.filter(|path| path.is_dir()));
        let mut all: Vec<_> = folders.map(|path| (self.picture_names(&path), path)).collect();
        // The last of the largest counts.
        all.sort_by(|a, b| a.0.len().cmp(&b.0.len()).then_with(|| b.1.cmp(&a.1)));
        let (mut names, folder) = all.pop().filter(|(names, _)| !names.is_empty())?;
        names.sort_by(|a, b| natural_order(a, b));
        Some((folder, names))
    }

    fn picture_names(&mut self, folder: &Path) -> Vec<String> {
        let names = self.folder(folder);
        let text = names.names.iter().filter_map(|name| name.to_str());
        text.filter(|name| is_picture(name)).map(str::to_owned).collect()
    }

    /// The files in `folder` that are called `name` with an extension after it, the most common one first.
    pub(super) fn extended(&mut self, folder: &Path, name: &str) -> Vec<PathBuf> {
        let (inner, name) = match name.rsplit_once('/') {
            Some((inner, name)) => (folder.join(inner), name),
            None => (folder.to_owned(), name),
        };
        let names = self.folder(&inner);
        let there = extensions().map(|end| format!("{name}.{end}"));
        let there = there.filter(|name| names.names.contains(OsStr::new(name)));
        there.map(|name| inner.join(name)).filter(|path| path.is_file()).collect()
    }

    /// The files below `folder` whose path is as like `parts` as `likeness` asks; folders may differ as names may.
    pub(super) fn files_like(&mut self, folder: &Path, parts: &[&str], likeness: Likeness) -> Vec<PathBuf> {
        let mut folders = vec![folder.to_owned()];
        let mut found = Vec::new();
        for (depth, part) in parts.iter().enumerate() {
            let mut inner = Vec::new();
            for folder in &folders {
                let names = self.folder(folder);
                // Archives from other systems leave names with the separators in them.
                let rest = parts[depth..].join("/");
                let files = names.alike(&rest, likeness).into_iter().map(|name| folder.join(name));
                found.extend(files.filter(|path| path.is_file()));
                if depth + 1 < parts.len() {
                    let like_folders = likeness.min(Likeness::Case);
                    inner.extend(names.alike(part, like_folders).into_iter().map(|name| folder.join(name)));
                }
            }
            inner.truncate(MOST_FOLDERS);
            folders = inner;
        }
        found
    }

    /// The folders in `folder` that are called like `name`.
    pub(super) fn inner(&mut self, folder: &Path, name: &str) -> Vec<PathBuf> {
        let names = self.folder(folder);
        let like = names.alike(name, Likeness::Case).into_iter().map(|name| folder.join(name));
        like.filter(|path| path.is_dir()).collect()
    }
}
