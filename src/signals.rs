//! Signals: one asks the program to come to an end, a second one ends it at once.

use nerf::support::interrupt::Interrupt;
use serde_json::json;
use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

/// A signal that comes so soon after the first is the same: programs like `timeout` send theirs to a process and to its
/// group, or two kinds at once.
const SAME: Duration = Duration::from_millis(50);
/// The same of SIGHUP: a terminal that closes sends one, and the shell in it another.
const SAME_HANGUP: Duration = Duration::from_secs(1);
/// Time to remove what was begun, where nothing else is to be brought to an end.
const TO_END: Duration = Duration::from_secs(1);

/// Listens to signals, from when it was made to the end of the program.
#[derive(Clone, Debug)]
pub(crate) struct Signals {
    /// Raised by the first signal.
    pub(crate) interrupt: Interrupt,
    state: Arc<State>,
}

#[derive(Debug, Default)]
struct State {
    /// The first signal; 0 before.
    first: AtomicI32,
    received: OnceLock<Instant>,
    /// Whether the program comes to an end by itself when the interrupt is raised.
    is_graceful: AtomicBool,
    /// Whether a result is to be printed in JSON.
    is_json: bool,
    is_answered: AtomicBool,
}

impl Signals {
    /// Listens from now on. Until [`Signals::end_gracefully`], the first signal ends the program at once, or nearly.
    pub(crate) fn listen(is_json: bool) -> Self {
        let state = State { is_json, ..State::default() };
        let signals = Self { interrupt: Interrupt::default(), state: Arc::new(state) };
        let heard = signals.clone();
        // Where that is not possible, signals do what they do without us.
        let _ = platform::listen(move |signal| heard.receive(signal));
        signals
    }

    /// From now on there is something to bring to an end: whoever asks the interrupt does that.
    pub(crate) fn end_gracefully(&self) {
        self.state.is_graceful.store(true, Ordering::SeqCst);
    }

    /// The exit code of a command that was interrupted: 128 and the signal.
    pub(crate) fn exit_code(&self) -> Option<u8> {
        let signal = self.state.first.load(Ordering::SeqCst);
        u8::try_from(signal).ok().filter(|signal| *signal > 0).map(|signal| 128 + signal)
    }

    /// Whether no result was printed so far, nor why there is none; whoever asks is about to.
    pub(crate) fn claim_answer(&self) -> bool {
        !self.state.is_answered.swap(true, Ordering::SeqCst)
    }

    /// Tells of the signal that interrupted the command, unless its result does.
    pub(crate) fn say_interrupted(&self) {
        self.say(self.state.first.load(Ordering::SeqCst));
    }

    fn say(&self, signal: i32) {
        if !self.claim_answer() {
            return;
        }
        let message = format!("interrupted by {}", platform::name(signal));
        // Nobody may be listening.
        if self.state.is_json {
            let answer = json!({ "error": message, "interrupted": true });
            let _ = writeln!(io::stdout(), "{answer}");
        }
        let _ = writeln!(io::stderr(), "error: {message}");
    }

    fn end(&self, signal: i32) -> ! {
        self.say(signal);
        platform::exit(128 + signal)
    }

    fn receive(&self, signal: i32) {
        match self.state.outcome(signal, Instant::now()) {
            Outcome::Same => {}
            Outcome::Second => self.end(signal),
            Outcome::First => {
                self.interrupt.raise();
                let late = self.clone();
                let hurry = move || {
                    thread::sleep(TO_END);
                    if !late.state.is_graceful.load(Ordering::SeqCst) {
                        late.end(signal);
                    }
                };
                if thread::Builder::new().name("end".to_owned()).spawn(hurry).is_err() {
                    self.end(signal);
                }
            }
        }
    }
}

/// What a signal asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// To come to an end.
    First,
    /// What the first one did.
    Same,
    /// To end at once.
    Second,
}

impl State {
    fn outcome(&self, signal: i32, now: Instant) -> Outcome {
        let first = *self.received.get_or_init(|| now);
        if self.first.compare_exchange(0, signal, Ordering::SeqCst, Ordering::SeqCst).is_ok() {
            return Outcome::First;
        }
        let same = if signal == platform::SIGHUP { SAME_HANGUP } else { SAME };
        if now.saturating_duration_since(first) < same { Outcome::Same } else { Outcome::Second }
    }
}

#[cfg(unix)]
mod platform {
    pub(super) use signal_hook::consts::SIGHUP;
    use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level;
    use std::io;
    use std::sync::Arc;
    use std::thread;

    /// Calls `receive` with every signal that asks for an end, on a thread of its own.
    pub(super) fn listen(receive: impl Fn(i32) + Send + 'static) -> io::Result<()> {
        // A file that becomes too large is an error of its write, which says so.
        signal_hook::flag::register(SIGXFSZ, Arc::default())?;
        // What a program like nohup ignores stays so; interrupts are ignored in every background job of a script.
        let caught =
            [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|&signal| signal != SIGHUP || !is_hup_ignored());
        let mut signals = Signals::new(caught)?;
        let listening = move || signals.forever().for_each(receive);
        thread::Builder::new().name("signals".to_owned()).spawn(listening).map(drop)
    }

    /// Whether SIGHUP was ignored when the program began. Where that cannot be told, it counts as if it was: then it does
    /// what it does without us.
    fn is_hup_ignored() -> bool {
        let ignored = || {
            let status = std::fs::read_to_string("/proc/self/status").ok()?;
            let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"))?;
            u64::from_str_radix(mask.trim(), 16).ok()
        };
        ignored().is_none_or(|mask| mask >> (SIGHUP - 1) & 1 == 1)
    }

    pub(super) fn name(signal: i32) -> &'static str {
        low_level::signal_name(signal).unwrap_or("a signal")
    }

    /// Ends the program without a look at what its other threads do.
    pub(super) fn exit(code: i32) -> ! {
        low_level::exit(code)
    }
}

#[cfg(not(unix))]
mod platform {
    use std::io;

    /// There is none.
    pub(super) const SIGHUP: i32 = 1;

    /// Calls `receive` at every Ctrl-C, on a thread of its own.
    pub(super) fn listen(receive: impl Fn(i32) + Send + 'static) -> io::Result<()> {
        ctrlc::set_handler(move || receive(2)).map_err(io::Error::other)
    }

    pub(super) fn name(_: i32) -> &'static str {
        "Ctrl-C"
    }

    pub(super) fn exit(code: i32) -> ! {
        std::process::exit(code)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_signal_asks_and_the_second_one_ends() {
        let (int, term) = (2, 15);
        let (state, start) = (State::default(), Instant::now());
        let outcome = |signal, after| state.outcome(signal, start + Duration::from_millis(after));
        assert_eq!(outcome(term, 0), Outcome::First);
        assert_eq!([outcome(term, 1), outcome(platform::SIGHUP, 900)], [Outcome::Same; 2]);
        assert_eq!([outcome(int, 50), outcome(platform::SIGHUP, 1000)], [Outcome::Second; 2]);
        assert_eq!(state.first.load(Ordering::SeqCst), term);
    }
}
