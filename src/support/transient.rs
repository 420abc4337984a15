//! Failures that may be gone when the same is tried again: nothing about what was asked for is wrong.

use super::lock::InUse;
use std::error::Error;
use std::fmt;
use std::io::{self, ErrorKind};

/// A failure that has to do with the moment, not with what was asked for, for example a lost device. Failures of files tell
/// it by their kind.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Transient(String);

impl Transient {
    /// What failed, and why.
    pub fn new(message: impl Into<String>) -> Self {
        Self(message.into())
    }
}

impl fmt::Display for Transient {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl Error for Transient {}

/// Whether the same may work when it is tried again: one of the causes is [`Transient`] or [`InUse`], or a file or
/// device could not be read or written for want of room, memory, a connection, or a disk that works.
#[must_use]
pub fn is_transient(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        cause.is::<Transient>() || cause.is::<InUse>() || cause.downcast_ref().is_some_and(may_pass)
    })
}

fn may_pass(error: &io::Error) -> bool {
    use ErrorKind as Kind;
    let kinds = [
        Kind::StorageFull,
        Kind::QuotaExceeded,
        Kind::FileTooLarge,
        Kind::OutOfMemory,
        Kind::ResourceBusy,
        Kind::WouldBlock,
        Kind::Interrupted,
        Kind::TimedOut,
        Kind::Deadlock,
        Kind::StaleNetworkFileHandle,
        Kind::NetworkDown,
        Kind::NetworkUnreachable,
        Kind::HostUnreachable,
        Kind::ConnectionAborted,
        Kind::ConnectionReset,
        Kind::NotConnected,
    ];
    kinds.contains(&error.kind()) || error.raw_os_error().is_some_and(is_transient_code)
}

/// EIO, ENXIO, ENODEV, ENFILE and EMFILE, which have no kind of their own: a disk that fails or has gone, and too many open
/// files.
fn is_transient_code(code: i32) -> bool {
    cfg!(unix) && [5, 6, 19, 23, 24].contains(&code)
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::{Context, anyhow};

    #[test]
    fn room_and_devices_may_come_back() {
        let of = |error: anyhow::Error| is_transient(&error.context("saving").context("training"));
        assert!(of(Transient::new("the device was lost").into()));
        for kind in [ErrorKind::StorageFull, ErrorKind::QuotaExceeded, ErrorKind::OutOfMemory] {
            assert!(of(io::Error::from(kind).into()), "{kind}");
        }
        for kind in [ErrorKind::NotFound, ErrorKind::PermissionDenied, ErrorKind::InvalidData] {
            assert!(!of(io::Error::from(kind).into()), "{kind}");
        }
        assert!(!of(anyhow!("the device was lost")));
    }

    /// As Linux, macOS and the BSDs number them.
    #[cfg(unix)]
    #[test]
    fn failing_disks_may_come_back() {
        for code in [5, 24, 28] {
            let failed = Err::<(), _>(io::Error::from_raw_os_error(code)).context("reading a.png");
            assert!(is_transient(&failed.expect_err("fails")), "{code}");
        }
        let missing = Err::<(), _>(io::Error::from_raw_os_error(2)).context("reading a.png");
        assert!(!is_transient(&missing.expect_err("fails")));
    }
}
