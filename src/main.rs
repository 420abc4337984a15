//! `nerf`: trains radiance fields and renders them, from the command line.

mod cli;
mod commands;
mod console;
mod flags;
mod narrator;
mod progress;
mod score_summary;

use clap::Parser;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = cli::Cli::try_parse().unwrap_or_else(|error| usage(&error));
    let Err(error) = commands::run(&cli) else { return ExitCode::SUCCESS };
    if is_broken_pipe(&error) {
        return ExitCode::SUCCESS;
    }
    let message = flags::with_flags(&error);
    // Where even this cannot be written, the exit code still tells.
    if cli.global.json && !error.is::<commands::Failed>() {
        let _ = writeln!(std::io::stdout(), "{}", serde_json::json!({ "error": message }));
    }
    let _ = writeln!(std::io::stderr(), "error: {message}");
    ExitCode::FAILURE
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
fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let cause = error.chain().find_map(|cause| cause.downcast_ref::<std::io::Error>());
    cause.is_some_and(|cause| cause.kind() == ErrorKind::BrokenPipe)
}
