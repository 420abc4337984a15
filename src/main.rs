//! `nerf`: trains radiance fields and renders them, from the command line.

mod cli;
mod commands;
mod console;
mod environment;
mod flags;
mod narrator;
mod progress;
mod score_summary;
mod signals;

use anyhow::Error;
use clap::Parser;
use nerf::support::interrupt::Interrupted;
use nerf::support::transient::is_transient;
use signals::Signals;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;

/// Failed for good: the same will fail again.
const FAILED: u8 = 1;
/// Failed for now: the same may work when it is tried again.
const TRY_AGAIN: u8 = 3;

fn main() -> ExitCode {
    let cli = cli::Cli::try_parse().unwrap_or_else(|error| usage(&error));
    environment::without_complaints();
    let signals = Signals::listen(cli.global.json);
    match commands::run(&cli, &signals) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => ExitCode::from(failed(&error, cli.global.json, &signals)),
    }
}

/// Says why a command failed, unless that was done; its exit code.
fn failed(error: &Error, is_json: bool, signals: &Signals) -> u8 {
    if Interrupted::is_cause_of(error) {
        signals.say_interrupted();
        return signals.exit_code().unwrap_or(FAILED);
    }
    if is_broken_pipe(error) {
        return signals.exit_code().unwrap_or_default();
    }
    let message = flags::with_flags(error);
    // Where even this cannot be written, the exit code still tells.
    if is_json && signals.claim_answer() {
        let _ = writeln!(std::io::stdout(), "{}", serde_json::json!({ "error": message }));
    }
    let _ = writeln!(std::io::stderr(), "error: {message}");
    if is_transient(error) { TRY_AGAIN } else { FAILED }
}

/// Ends the program as clap does: with help, the version, or a mistake in the command line, which is also said in JSON
/// where that is asked for.
fn usage(error: &clap::Error) -> ! {
    if error.use_stderr() && std::env::args().any(|argument| argument == "--json") {
        let message = error.render().to_string();
        let _ = writeln!(std::io::stdout(), "{}", serde_json::json!({ "error": message.trim() }));
    }
    error.exit()
}

/// Whether whoever read our output has gone, which is no failure.
fn is_broken_pipe(error: &Error) -> bool {
    let cause = error.chain().find_map(|cause| cause.downcast_ref::<std::io::Error>());
    cause.is_some_and(|cause| cause.kind() == ErrorKind::BrokenPipe)
}
