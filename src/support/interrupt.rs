//! A wish to stop, which whatever takes long asks for.

use std::error::Error;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// A wish to stop, raised at most once. Its clones are one.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Asks for an end.
    pub fn raise(&self) {
        self.0.store(true, Ordering::SeqCst);
    }

    /// Whether an end was asked for.
    #[must_use]
    pub fn is_raised(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }

    /// Sleeps, until an end is asked for at most.
    pub fn sleep(&self, duration: Duration) {
        let start = Instant::now();
        while !self.is_raised() && start.elapsed() < duration {
            thread::sleep(Duration::from_millis(20).min(duration));
        }
    }

    /// Fails where an end was asked for.
    ///
    /// # Errors
    /// [`Interrupted`].
    pub fn check(&self) -> Result<(), Interrupted> {
        if self.is_raised() { Err(Interrupted) } else { Ok(()) }
    }
}

/// Something ended before it was done, because that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interrupted;

impl Interrupted {
    /// Whether this is why something failed.
    #[must_use]
    pub fn is_cause_of(error: &anyhow::Error) -> bool {
        error.chain().any(|cause| cause.is::<Self>())
    }
}

impl fmt::Display for Interrupted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("interrupted")
    }
}

impl Error for Interrupted {}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::{Context, anyhow};

    #[test]
    fn what_is_raised_stays_so_and_is_found_among_causes() {
        let interrupt = Interrupt::default();
        assert_eq!(interrupt.check(), Ok(()));
        interrupt.clone().raise();
        interrupt.sleep(Duration::MAX);
        let failed = interrupt.check().context("rendering").expect_err("raised");
        assert!(interrupt.is_raised() && Interrupted::is_cause_of(&failed));
        assert!(!Interrupted::is_cause_of(&anyhow!("interrupted")));
    }
}
