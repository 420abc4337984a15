//! Progress on stderr: a bar on a terminal, a line every few seconds elsewhere, nothing when quiet.

use crate::remarks::Remarks;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Time between two lines where there is no terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(5);
/// Resolution of the bar.
const PARTS: f64 = 1000.0;

/// How far something is.
#[derive(Debug)]
pub(crate) struct Progress {
    remarks: Remarks,
    bar: Option<ProgressBar>,
    last_line: Mutex<Instant>,
}

impl Progress {
    /// Begins something called `title`.
    pub(crate) fn new(remarks: Remarks, title: &str) -> Self {
        let is_shown = !remarks.quiet && std::io::stderr().is_terminal();
        let bar = is_shown.then(|| {
            let bar = ProgressBar::with_draw_target(Some(PARTS as u64), ProgressDrawTarget::stderr());
            if let Ok(style) = ProgressStyle::with_template("{prefix} {bar:24} {msg}") {
                bar.set_style(style);
            }
            bar.set_prefix(title.to_owned());
            bar
        });
        Self { remarks, bar, last_line: Mutex::new(Instant::now()) }
    }

    /// `part` of it in `[0, 1]` is done, and `line` says more.
    pub(crate) fn update(&self, part: f64, line: impl FnOnce() -> String) {
        if let Some(bar) = &self.bar {
            bar.set_position((part * PARTS) as u64);
            bar.set_message(line());
            return;
        }
        let Ok(mut last) = self.last_line.lock() else { return };
        if !self.remarks.quiet && last.elapsed() >= BETWEEN_LINES {
            *last = Instant::now();
            self.remarks.say(&line());
        }
    }

    /// `done` of `all` things are done.
    pub(crate) fn count(&self, done: usize, all: usize, things: &str) {
        self.update(done as f64 / all.max(1) as f64, || format!("{done} of {all} {things}"));
    }

    /// A line that stays.
    pub(crate) fn say(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| self.remarks.say(line)),
            None => self.remarks.say(line),
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

/// A duration as people say it.
pub(crate) fn duration(seconds: f64) -> String {
    match seconds.max(0.0).round() as u64 {
        _ if seconds < 10.0 => format!("{:.1} s", seconds.max(0.0)),
        seconds @ 0..120 => format!("{seconds} s"),
        seconds @ 120..7200 => format!("{} min {:02} s", seconds / 60, seconds % 60),
        seconds => format!("{} h {:02} min", seconds / 3600, seconds / 60 % 60),
    }
}

/// A rate or count with a unit prefix.
pub(crate) fn short(number: f64) -> String {
    match number {
        number if number >= 1e6 => format!("{:.1}M", number / 1e6),
        number if number >= 1e3 => format!("{:.1}k", number / 1e3),
        number => format!("{number:.0}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let all = [0.25, 42.4, 119.0, 125.0, 7384.0].map(duration);
        assert_eq!(all, ["0.2 s", "42 s", "119 s", "2 min 05 s", "2 h 03 min"]);
        assert_eq!([7.0, 1234.0, 5.67e6].map(short), ["7", "1.2k", "5.7M"]);
    }
}
