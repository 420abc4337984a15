//! `nerf check`: every kernel on this adapter against the reference, or golden rays from a file.

use super::{Failed, Session};
use crate::cli::check::Check;
use crate::progress::{Progress, duration};
use anyhow::Result;
use nerf::config::Accumulation;
use nerf::verify::check::fused::{BOUND, golden_rays};
use nerf::verify::check::{self, CheckResult, CheckedAdapter, Forced};
use nerf::verify::reference::vectors::{GoldenFile, RayError};
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

pub(super) fn run(args: &Check, session: &Session<'_>) -> Result<()> {
    let file = args.vectors.as_deref().map(GoldenFile::load).transpose()?;
    let gpu = session.open_gpu()?;
    let adapter = CheckedAdapter::new(&gpu, forced(args))?;
    let heading = format!("adapter  {}\npath     {}", gpu.info.name, adapter.describe()?);
    if session.global.json {
        session.console.say(&heading);
    }
    match (&args.vectors, &file) {
        (Some(path), Some(file)) => rays(&adapter, file, path, &heading, session),
        _ => kernels(&adapter, &heading, session),
    }
}

fn forced(args: &Check) -> Forced {
    let is_forced = args.accumulation != Accumulation::Auto;
    Forced {
        accumulation: is_forced.then_some(args.accumulation),
        memory: args.memory,
        product: args.product,
    }
}

/// Checks all kernels and prints the table.
fn kernels(adapter: &CheckedAdapter, heading: &str, session: &Session<'_>) -> Result<()> {
    let start = Instant::now();
    let progress = Progress::new(session.console, "checking");
    let results = check::run(adapter, &|done, all, name| {
        progress.update(done as f64 / all as f64, || format!("{name} ({} of {all})", done + 1));
    })?;
    drop(progress);
    let broken = results.iter().filter(|result| !result.pass).count();
    let worst = results.iter().fold(0.0, |worst: f64, result| worst.max(result.worst));
    let mut lines = vec![heading.to_owned(), table(&results)];
    let time = duration(start.elapsed().as_secs_f64());
    let verdict = match broken {
        0 => format!("all {} bounds are kept", results.len()),
        _ => format!("{broken} of {} bounds are broken", results.len()),
    };
    lines.push(format!("{verdict}; the checks took {time}"));
    let result = json!({
        "adapter": adapter.gpu.info.name, "pass": broken == 0, "worst": worst, "kernels": results, "rays": []
    });
    finish(session, &result, &lines.join("\n"), broken == 0, verdict)
}

/// One line per result, and under it the worst case of one whose bound is broken.
fn table(results: &[CheckResult]) -> String {
    let width = results.iter().map(|result| result.name.chars().count()).max().unwrap_or(0);
    let mut lines =
        vec![format!("{:width$}  {:>8}  {:>8}  {:>8}        bound by", "kernel", "cases", "worst", "bound")];
    for CheckResult { name, cases, worst, bound, pass, source, case } in results {
        let verdict = if *pass { "pass" } else { "FAIL" };
        lines.push(format!("{name:width$}  {cases:>8}  {worst:>8.1e}  {bound:>8.1e}  {verdict}  {source}"));
        if !pass {
            lines.push(format!("{:width$}  worst: {case}", ""));
        }
    }
    lines.join("\n")
}

/// Checks the rays of a file and prints them.
fn rays(
    adapter: &CheckedAdapter,
    file: &GoldenFile,
    path: &Path,
    heading: &str,
    session: &Session<'_>,
) -> Result<()> {
    let errors = golden_rays(adapter, file)?;
    let pass = |error: &RayError| error.finite && error.error <= BOUND;
    let broken = errors.iter().filter(|error| !pass(error)).count();
    let worst = errors.iter().fold(0.0, |worst: f64, error| worst.max(error.error));
    let named = || file.rays.iter().map(|ray| ray.name.as_str()).zip(&errors);
    let entries: Vec<Value> = named()
        .map(|(name, error)| json!({ "name": name, "error": error.error, "finite": error.finite }))
        .collect();
    let width = named().map(|(name, _)| name.chars().count()).max().unwrap_or(0).max(3);
    let mut lines = vec![heading.to_owned(), format!("{:width$}     error        worst in", "ray")];
    lines.extend(named().map(|(name, error)| {
        let verdict = if pass(error) { "pass" } else { "FAIL" };
        format!("{name:width$}  {:>8.1e}  {verdict}  {}", error.error, error.quantity)
    }));
    let count = errors.len();
    let verdict = match broken {
        0 => format!("all {count} rays of {} are within {BOUND:.0e}", path.display()),
        _ => format!("{broken} of {count} rays of {} are beyond {BOUND:.0e}", path.display()),
    };
    lines.push(format!("{verdict}; worst {worst:.1e}, {:?} transmittance", file.transmittance));
    let result = json!({
        "adapter": adapter.gpu.info.name, "pass": broken == 0, "worst": worst, "kernels": [], "rays": entries
    });
    finish(session, &result, &lines.join("\n"), broken == 0, verdict)
}

fn finish(session: &Session<'_>, json: &Value, text: &str, pass: bool, verdict: String) -> Result<()> {
    session.print(json, text)?;
    if pass { Ok(()) } else { Err(Failed(verdict).into()) }
}
