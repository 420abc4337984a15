//! Data that tests use where it is there: large, or not ours to publish.

use std::path::{Path, PathBuf};

/// A folder of the shared data, or `None` with a line on stderr where it is not there.
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
