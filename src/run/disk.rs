//! Whether there is room on the disk for what a training run saves, before it begins.

use super::event::{Event, Observer, Warning};
use crate::support::file::available_bytes;
use crate::support::format::bytes;
use anyhow::{Result, bail};
use std::io::{Error, ErrorKind};
use std::path::Path;

/// Bytes of the configuration, the log and the page about the run.
const OTHERS: u64 = 4 << 20;

/// Whether a checkpoint of so many bytes fits into the file system of `folder`. Where it has hardly room for `most` of them,
/// that is reported.
///
/// # Errors
/// When there is room for none; the cause is of the kind [`ErrorKind::StorageFull`].
pub(super) fn check(folder: &Path, checkpoint: u64, most: u64, observer: &mut dyn Observer) -> Result<()> {
    let Some(available) = available_bytes(folder) else { return Ok(()) };
    if available < checkpoint {
        let found = format!(
            "a checkpoint takes {}, and the file system of {} has {} left; make room, or name a folder on another disk",
            bytes(checkpoint),
            folder.display(),
            bytes(available)
        );
        bail!(Error::new(ErrorKind::StorageFull, found));
    }
    let needed = most.saturating_mul(checkpoint).saturating_add(OTHERS);
    if available < needed {
        observer.notice(&Event::Warning(Warning::LittleRoom { needed, available, folder }));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused() {
        let folder = tempfile::tempdir().expect("temporary folder");
        check(folder.path(), 1, 3, &mut ()).expect("a byte fits");
        let error = check(folder.path(), u64::MAX / 8, 3, &mut ()).expect_err("too much");
        let cause = error.downcast_ref::<Error>().expect("of files");
        assert_eq!(cause.kind(), ErrorKind::StorageFull);
        assert!(cause.to_string().contains("left; make room"), "{cause}");
    }
}
