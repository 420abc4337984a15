//! `nerf bench`: error against run time.

mod training;

use super::Session;
use crate::cli::bench::Bench;
use anyhow::Result;

pub(super) fn run(what: &Bench, session: &Session<'_>) -> Result<()> {
    match what {
        Bench::Training(args) => training::run(args, session),
    }
}
