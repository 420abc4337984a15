//! What the tests of the library and those of the program both need: folders, and data where it is there.

use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// An empty folder, for as long as what is returned lives.
pub(crate) fn folder() -> TempDir {
    tempfile::tempdir().expect("temporary folder")
}

/// The files of a folder with this extension, in order.
pub(crate) fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("readable").path());
    let has_extension = |path: &PathBuf| path.extension().is_some_and(|found| found == extension);
    let mut files: Vec<_> = entries.filter(has_extension).collect();
    files.sort();
    files
}

/// A folder of the shared data, which is large or not ours to publish, or `None` with a line on stderr where it is not
/// there.
pub(crate) fn shared(name: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let root = std::env::var_os("NERF_SHARED").map_or_else(beside, PathBuf::from);
    let path = root.join(name);
    if !path.exists() {
        eprintln!("skipped: {} is not there", path.display());
        return None;
    }
    Some(path)
}
