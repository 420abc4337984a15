//! Making things in parallel and handing them over one by one, in order, with few of them at a time.

use std::collections::BTreeMap;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;

use anyhow::{Result, bail};

/// Most bytes of all things that are being made or wait to be handed over, unless a single one takes more.
pub(super) const PREFETCH_BYTES: u64 = 1 << 30;

/// Most things at a time: one for each thread that makes them, and the one that was handed over.
fn most_at_a_time() -> usize {
    rayon::current_num_threads() + 1
}

/// Most bytes at a time, where things take up to `largest` bytes each.
pub(super) fn most_bytes(count: usize, largest: u64) -> u64 {
    let all = largest.saturating_mul(count.min(most_at_a_time()) as u64);
    all.min(PREFETCH_BYTES.max(largest))
}

/// Makes the things number 0 to `bytes.len() - 1`, which take so many bytes each, on as many threads as rayon
/// has, and hands them to `take` in their order, on this thread. Stops at the first failure, of either.
pub(super) fn prefetch<T: Send>(
    bytes: &[u64],
    make: &(dyn Fn(usize) -> Result<T> + Sync),
    take: &mut dyn FnMut(usize, T) -> Result<()>,
) -> Result<()> {
    let pipeline = Pipeline { bytes, state: Mutex::new(Queue::default()), changed: Condvar::new() };
    thread::scope(|scope| {
        for _ in 0..rayon::current_num_threads().min(bytes.len()) {
            scope.spawn(|| pipeline.work(make));
        }
        // Whatever happens here, the threads are to end.
        let _stop = Stop(&pipeline);
        for number in 0..bytes.len() {
            let Some(made) = pipeline.wait_for(number) else {
                bail!("decoding was interrupted by a failure")
            };
            take(number, made?)?;
            pipeline.release(number);
        }
        Ok(())
    })
}

struct Pipeline<'a, T> {
    bytes: &'a [u64],
    state: Mutex<Queue<T>>,
    changed: Condvar,
}

struct Queue<T> {
    /// Number of the next thing to make.
    next: usize,
    /// Bytes and number of the things begun and not yet released.
    held_bytes: u64,
    held: usize,
    made: BTreeMap<usize, Result<T>>,
    is_stopped: bool,
}

impl<T> Default for Queue<T> {
    fn default() -> Self {
        Self { next: 0, held_bytes: 0, held: 0, made: BTreeMap::new(), is_stopped: false }
    }
}

/// Stops everything when dropped, also by a panic: nobody is left waiting.
struct Stop<'a, 'b, T>(&'a Pipeline<'b, T>);

impl<T> Drop for Stop<'_, '_, T> {
    fn drop(&mut self) {
        self.0.lock().is_stopped = true;
        self.0.changed.notify_all();
    }
}

impl<T> Pipeline<'_, T> {
    fn lock(&self) -> MutexGuard<'_, Queue<T>> {
        // The state is changed in single assignments, and is good even if somebody panicked.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'s>(&self, state: MutexGuard<'s, Queue<T>>) -> MutexGuard<'s, Queue<T>> {
        self.changed.wait(state).unwrap_or_else(PoisonError::into_inner)
    }

    fn work(&self, make: &(dyn Fn(usize) -> Result<T> + Sync)) {
        let stop = Stop(self);
        while let Some(number) = self.begin() {
            let made = make(number);
            let failed = made.is_err();
            self.lock().made.insert(number, made);
            self.changed.notify_all();
            if failed {
                break;
            }
        }
        // Only a panic is to stop the others.
        std::mem::forget(stop);
    }

    /// The next thing to make, once there is room for it; `None` when there is nothing more to do.
    fn begin(&self) -> Option<usize> {
        let mut state = self.lock();
        loop {
            let number = state.next;
            let &bytes = self.bytes.get(number).filter(|_| !state.is_stopped)?;
            let fits = state.held < most_at_a_time() && state.held_bytes + bytes <= PREFETCH_BYTES;
            if state.held == 0 || fits {
                state.next += 1;
                state.held += 1;
                state.held_bytes += bytes;
                return Some(number);
            }
            state = self.wait(state);
        }
    }

    /// Thing `number` when it is made; `None` if it never will be.
    fn wait_for(&self, number: usize) -> Option<Result<T>> {
        let mut state = self.lock();
        loop {
            if let Some(made) = state.made.remove(&number) {
                return Some(made);
            }
            if state.is_stopped {
                return None;
            }
            state = self.wait(state);
        }
    }

    fn release(&self, number: usize) {
        let mut state = self.lock();
        state.held -= 1;
        state.held_bytes -= self.bytes[number];
        drop(state);
        self.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    /// Counts those alive, and the most of them.
    #[derive(Default)]
    struct Census {
        alive: AtomicUsize,
        most: AtomicUsize,
    }

    struct Thing<'a>(usize, &'a Census);

    impl<'a> Thing<'a> {
        fn new(number: usize, census: &'a Census) -> Self {
            let alive = census.alive.fetch_add(1, Ordering::SeqCst) + 1;
            census.most.fetch_max(alive, Ordering::SeqCst);
            Self(number, census)
        }
    }

    impl Drop for Thing<'_> {
        fn drop(&mut self) {
            self.1.alive.fetch_sub(1, Ordering::SeqCst);
        }
    }

    /// Hands over `count` things of so many bytes: the most alive at a time.
    fn most_alive(count: usize, bytes: u64) -> usize {
        let census = Census::default();
        let mut next = 0;
        let make = |number: usize| {
            // The later, the faster.
            thread::sleep(Duration::from_micros(200 * (count - number) as u64 % 1000));
            Ok(Thing::new(number, &census))
        };
        prefetch(&vec![bytes; count], &make, &mut |number, thing| {
            assert_eq!((number, thing.0), (next, next));
            next += 1;
            Ok(())
        })
        .expect("nothing fails");
        assert_eq!((next, census.alive.into_inner()), (count, 0));
        census.most.into_inner()
    }

    #[test]
    fn things_come_in_order_and_few_at_a_time() {
        assert!(most_alive(50, 1) <= most_at_a_time());
        assert_eq!(most_alive(9, PREFETCH_BYTES), 1, "as many as fit");
        assert_eq!(most_alive(5, 3 * PREFETCH_BYTES), 1, "one that does not fit is alone");
        assert!(most_alive(20, PREFETCH_BYTES / 2) <= 2);
        assert_eq!(most_alive(0, 1), 0);
        assert_eq!(most_bytes(100, 10), 10 * most_at_a_time() as u64);
        assert_eq!(most_bytes(1, 10), 10);
        assert_eq!(most_bytes(9, 2 * PREFETCH_BYTES), 2 * PREFETCH_BYTES);
    }

    #[test]
    fn failures_end_it_at_their_place() {
        let make = |number: usize| if number == 7 { bail!("seven") } else { Ok(number) };
        let mut taken = Vec::new();
        let failed = prefetch(&[1; 30], &make, &mut |_, number| {
            taken.push(number);
            Ok(())
        });
        assert_eq!(failed.expect_err("fails").to_string(), "seven");
        assert_eq!(taken, (0..7).collect::<Vec<_>>());
        let failed =
            prefetch(&[1; 30], &|n| Ok(n), &mut |n, _: usize| if n == 3 { bail!("taker") } else { Ok(()) });
        assert_eq!(failed.expect_err("fails").to_string(), "taker");
    }

    #[test]
    fn a_panic_leaves_nobody_waiting() {
        let attempt = std::panic::catch_unwind(|| {
            let make = |number: usize| {
                assert!(number != 2, "as if a decoder panicked");
                Ok(number)
            };
            prefetch(&[1; 30], &make, &mut |_, _| Ok(()))
        });
        assert!(attempt.is_err());
    }
}
