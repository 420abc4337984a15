//! The host's memory: how much there is left for this process, and how much it has taken.

use std::fs::read_to_string;
use std::path::{Path, PathBuf};
use sysinfo::{MemoryRefreshKind, RefreshKind, System};

/// Where Linux tells of the groups that processes are in, whose memory may be limited.
const GROUPS: &str = "/sys/fs/cgroup";

/// Bytes that this process can still get, within the limits of its container or job; `None` where the system does not
/// say.
#[must_use]
pub fn available_bytes() -> Option<u64> {
    let memory = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
    let free = System::new_with_specifics(memory).available_memory();
    let own = read_to_string("/proc/self/cgroup").unwrap_or_default();
    let limited = limited_bytes(Path::new(GROUPS), &own);
    [Some(free).filter(|&free| free > 0), limited].into_iter().flatten().min()
}

/// The most bytes that this process has had in use; `None` where the system does not say.
#[must_use]
pub fn peak_bytes() -> Option<u64> {
    let status = read_to_string("/proc/self/status").ok()?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kilobytes: u64 = peak.trim().strip_suffix(" kB")?.parse().ok()?;
    Some(kilobytes << 10)
}

/// Bytes left in the most limited of the groups below `root` that a process is in: those of `own`, the text of its
/// `/proc/self/cgroup`, and all around them. `None` where none is limited.
fn limited_bytes(root: &Path, own: &str) -> Option<u64> {
    let groups = own.lines().filter_map(|line| {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, path) = (parts.next()?, parts.next()?);
        // The second version has one tree, the first one for each kind of limit.
        let (root, files) = match controllers {
            "" => (root.to_owned(), SECOND),
            _ if controllers.split(',').any(|kind| kind == "memory") => (root.join("memory"), FIRST),
            _ => return None,
        };
        // A container sees its own group as the root, under whatever name.
        let inner = path.trim_start_matches('/');
        let deepest = if inner.contains("..") { root.clone() } else { root.join(inner) };
        let around: Vec<PathBuf> =
            deepest.ancestors().take_while(|group| group.starts_with(&root)).map(Path::to_owned).collect();
        around.iter().filter_map(|group| files.left(group)).min()
    });
    groups.min()
}

/// Names of the files of a group.
struct GroupFiles {
    limit: &'static str,
    used: &'static str,
    /// Rows of `memory.stat`: pages of files, which are given up when memory is needed.
    reclaimable: [&'static str; 2],
}

const FIRST: GroupFiles = GroupFiles {
    limit: "memory.limit_in_bytes",
    used: "memory.usage_in_bytes",
    reclaimable: ["total_active_file", "total_inactive_file"],
};
const SECOND: GroupFiles =
    GroupFiles { limit: "memory.max", used: "memory.current", reclaimable: ["active_file", "inactive_file"] };

impl GroupFiles {
    /// Bytes that the group has left; `None` where it has no limit.
    fn left(&self, group: &Path) -> Option<u64> {
        let number = |name: &str| read_to_string(group.join(name)).ok()?.trim().parse::<u64>().ok();
        let (limit, used) = (number(self.limit)?, number(self.used)?);
        let rows = read_to_string(group.join("memory.stat")).unwrap_or_default();
        let row = |line: &str| {
            let (name, value) = line.split_once(' ')?;
            self.reclaimable.contains(&name).then(|| value.parse::<u64>().ok())?
        };
        let reclaimable: u64 = rows.lines().filter_map(row).sum();
        Some(limit.saturating_sub(used.saturating_sub(reclaimable)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{create_dir_all, write};

    #[test]
    fn this_machine_has_memory() {
        assert!(available_bytes().is_none_or(|bytes| bytes > 1 << 20));
        assert!(peak_bytes().is_none_or(|bytes| bytes > 1 << 20));
    }

    #[test]
    fn the_most_limited_group_counts() {
        let folder = tempfile::tempdir().expect("a folder");
        let group = |path: &str, files: &[(&str, &str)]| {
            let group = folder.path().join(path);
            create_dir_all(&group).expect("created");
            files.iter().for_each(|(name, text)| write(group.join(name), text).expect("written"));
        };
        let left = |own: &str| limited_bytes(folder.path(), own);
        let stat = "anon 40\nactive_file 20\ninactive_file 30\nfile 60\n";
        group("slice/job", &[("memory.max", "max\n"), ("memory.current", "90\n"), ("memory.stat", stat)]);
        assert_eq!(left("0::/slice/job\n"), None, "nothing is limited");
        group("slice", &[("memory.max", "400\n"), ("memory.current", "90\n"), ("memory.stat", stat)]);
        assert_eq!(left("0::/slice/job\n"), Some(360), "files are given up");
        assert_eq!(left("0::/other\n"), None);
        // Of the first version, as Docker shows it within and without.
        let stat = "cache 60\ntotal_active_file 20\ntotal_inactive_file 30\n";
        let files =
            [("memory.limit_in_bytes", "300\n"), ("memory.usage_in_bytes", "90\n"), ("memory.stat", stat)];
        group("memory", &files);
        let lines = "8:pids:/docker/7f\n4:memory:/docker/7f\n0::/slice/job\n";
        assert_eq!(left(lines), Some(260));
        group("memory/docker/7f", &[("memory.limit_in_bytes", "100\n"), ("memory.usage_in_bytes", "120\n")]);
        assert_eq!(left(lines), Some(0));
        assert_eq!(left("4:memory:/../../7f\n"), Some(260), "never above the root");
        assert_eq!(left("nonsense"), None);
    }
}
