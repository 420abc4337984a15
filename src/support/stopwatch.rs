//! Time in which this process ran.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant};

/// Time between two beats.
const BEAT: Duration = Duration::from_millis(20);
/// No beat comes later than that, unless the whole process stands still.
const LATEST: Duration = Duration::from_millis(500);

/// Tells the seconds since it was made, without those in which the process stood still: Ctrl-Z, a signal to stop, a machine
/// that sleeps. Nobody tells a process of them; but a thread that wakes all the time finds that it did not.
#[derive(Debug)]
pub struct Stopwatch {
    beats: Arc<Mutex<Beats>>,
}

#[derive(Debug)]
struct Beats {
    ran: Duration,
    last: Instant,
    /// What lies farther back than this was no time: the process stood still.
    latest: Duration,
}

impl Beats {
    /// The time that the process ran up to `now`.
    fn at(&mut self, now: Instant) -> Duration {
        let gap = now.saturating_duration_since(self.last);
        self.ran += if gap > self.latest { BEAT } else { gap };
        self.last = now;
        self.ran
    }
}

impl Default for Stopwatch {
    fn default() -> Self {
        let beats = Beats { ran: Duration::ZERO, last: Instant::now(), latest: LATEST };
        let beats = Arc::new(Mutex::new(beats));
        let beating = Arc::downgrade(&beats);
        if thread::Builder::new().name("stopwatch".to_owned()).spawn(move || beat(&beating)).is_err() {
            // Nothing beats: all time counts.
            lock(&beats).latest = Duration::MAX;
        }
        Self { beats }
    }
}

impl Stopwatch {
    /// Seconds since it was made in which the process ran.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        lock(&self.beats).at(Instant::now()).as_secs_f64()
    }
}

/// Beats as long as the stopwatch is there.
fn beat(beats: &Weak<Mutex<Beats>>) {
    while let Some(beats) = beats.upgrade() {
        lock(&beats).at(Instant::now());
        drop(beats);
        thread::sleep(BEAT);
    }
}

fn lock(beats: &Mutex<Beats>) -> MutexGuard<'_, Beats> {
    beats.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_does_not_pass_while_nothing_beats() {
        let start = Instant::now();
        let mut beats = Beats { ran: Duration::ZERO, last: start, latest: LATEST };
        let at = |milliseconds| start + Duration::from_millis(milliseconds);
        assert_eq!(beats.at(at(20)), Duration::from_millis(20));
        assert_eq!(beats.at(at(220)), Duration::from_millis(220), "a busy machine");
        assert_eq!(beats.at(at(3_600_000)), Duration::from_millis(240), "an hour of Ctrl-Z");
        assert_eq!(beats.at(at(3_600_020)), Duration::from_millis(260));
        assert_eq!(beats.at(at(0)), Duration::from_millis(260), "no time runs backwards");
    }

    #[test]
    fn a_stopwatch_runs() {
        let watch = Stopwatch::default();
        let before = watch.seconds();
        thread::sleep(Duration::from_millis(30));
        assert!(watch.seconds() - before >= 0.02);
    }
}
