//! Progress on stderr: a bar on a terminal, a line every few seconds elsewhere, nothing when quiet.

use crate::console::Console;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

pub(crate) use nerf::support::format::{duration, short};

/// Time between two lines where there is no terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(5);
/// Resolution of the bar.
const PARTS: f64 = 1000.0;

/// How far something is.
#[derive(Debug)]
pub(crate) struct Progress {
    console: Console,
    bar: Option<ProgressBar>,
    last_line: Mutex<Instant>,
}

impl Progress {
    /// Begins something called `title`.
    pub(crate) fn new(console: Console, title: &str) -> Self {
        let is_shown = !console.quiet && std::io::stderr().is_terminal();
        let bar = is_shown.then(|| {
            let bar = ProgressBar::with_draw_target(Some(PARTS as u64), ProgressDrawTarget::stderr());
            if let Ok(style) = ProgressStyle::with_template("{prefix} {bar:24} {msg}") {
                bar.set_style(style);
            }
            bar.set_prefix(title.to_owned());
            bar
        });
        Self { console, bar, last_line: Mutex::new(Instant::now()) }
    }

    /// `part` of it in `[0, 1]` is done, and `line` says more.
    pub(crate) fn update(&self, part: f64, line: impl FnOnce() -> String) {
        if let Some(bar) = &self.bar {
            bar.set_position((part * PARTS) as u64);
            bar.set_message(line());
            return;
        }
        let Ok(mut last) = self.last_line.lock() else { return };
        if !self.console.quiet && last.elapsed() >= BETWEEN_LINES {
            *last = Instant::now();
            self.console.say(&line());
        }
    }

    /// `done` of `all` things are done.
    pub(crate) fn count(&self, done: usize, all: usize, things: &str) {
        self.update(done as f64 / all.max(1) as f64, || format!("{done} of {all} {things}"));
    }

    /// A line that stays.
    pub(crate) fn say(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| self.console.say(line)),
            None => self.console.say(line),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
