//! `nerf info`: what training would make of a dataset, before it takes a night.

mod json_report;
mod problems;
mod text_report;

use super::{Failed, Session};
use crate::cli::info::Info;
use crate::flags::{message_with_flags, with_flags};
use crate::progress::Progress;
use anyhow::{Error, Result};
use nerf::capture::dataset::{Dataset, OpenOptions};
use nerf::capture::diagnostics::{Diagnostic, Severity};
use nerf::capture::health::Survey;
use nerf::capture::health::depth::DepthSurvey;
use nerf::capture::health::gallery::{Gallery, Look};
use nerf::capture::health::map;
use nerf::capture::health::parallax::ParallaxSurvey;
use nerf::capture::unreadable::{Kind, Unreadable, kinds};
use nerf::config::Config;
use nerf::gpu::Gpu;
use nerf::photo::Reading;
use nerf::run::{Estimate, Settings, TrainOptions};
use nerf::support::file::write_atomically;
use nerf::support::transient::is_transient;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::io::Write;
use std::sync::atomic::{AtomicUsize, Ordering};

/// All there is to say about a dataset.
#[derive(Debug)]
struct Preflight<'a> {
    args: &'a Info,
    dataset: &'a Dataset,
    survey: Survey,
    /// `None` where the photos were not looked at.
    gallery: Option<Gallery>,
    /// `None` where the photos were not looked at, or have no depth.
    depth: Option<DepthSurvey>,
    /// `None` where there is nothing to train on.
    memory: Option<Estimate>,
    /// Worst first.
    problems: Vec<Diagnostic>,
}

pub(super) fn run(args: &Info, session: &Session<'_>) -> Result<()> {
    let options = OpenOptions {
        hold_out: args.hold_out,
        allow_missing: true,
        reading: args.reading.over(Reading::default()),
    };
    let dataset = match Dataset::open(&args.dataset, &options) {
        Ok(dataset) => dataset,
        Err(error) => return unreadable(args, error, session),
    };
    let mut report = inspect(args, &dataset, session)?;
    for problem in &mut report.problems {
        problem.message = message_with_flags(&problem.message, problem.remedy.as_ref());
    }
    report.problems.sort_by_key(|problem| problem.severity);
    session.print(&report.json(), &report.text())?;
    if let Some(path) = &args.plot {
        let marked = (report.problems.iter().filter(|problem| problem.severity != Severity::Note))
            .flat_map(|problem| problem.frames.iter().copied());
        let drawing = map::draw(&dataset, &report.survey, &marked.collect());
        write_atomically(path, |file| Ok(file.write_all(drawing.svg().as_bytes())?))?;
    }
    match report.problems.first().filter(|problem| problem.severity == Severity::Error) {
        Some(problem) if session.global.json => {
            Err(Failed(format!("training would fail: {}", problem.message)).into())
        }
        // What was printed as text is not said again.
        Some(_) => Err(Failed("training would fail, as the report tells".to_owned()).into()),
        None => Ok(()),
    }
}

/// Looks at cameras, photos and memory.
fn inspect<'a>(args: &'a Info, dataset: &'a Dataset, session: &Session<'_>) -> Result<Preflight<'a>> {
    let survey = Survey::of(dataset);
    let mut problems = problems::of_dataset(dataset);
    problems.extend(survey.findings.iter().cloned());
    let mut gallery = None;
    if !args.no_photos && problems::found(dataset) > 0 {
        let parallax = ParallaxSurvey::of(dataset, &dataset.train, &dataset.bounds);
        let (all, failures) = look(dataset, &survey.views, &parallax, session)?;
        problems.extend(failures);
        gallery = Some(all);
        problems.extend(parallax.finding());
    }
    problems.extend(survey.findings_with(gallery.as_ref(), dataset));
    let mut memory = None;
    let mut is_depth_used = false;
    if !dataset.train.is_empty() {
        // An adapter that was asked for must be there.
        let gpu = match session.open_gpu() {
            Err(error) if session.global.adapter.is_some() => return Err(error),
            opened => opened.ok(),
        };
        let config = config(args, dataset, gpu.as_deref())?;
        is_depth_used = config.loss.depth > 0.0;
        match Estimate::of(dataset, gpu.as_deref(), config) {
            Ok(estimate) => {
                problems.extend(problems::of_memory(&estimate));
                memory = Some(estimate);
            }
            Err(error) => problems.push(Diagnostic::error(with_flags(&error))),
        }
    }
    let has_depth = dataset.frames.iter().any(|frame| frame.has_depth);
    let depth = (has_depth && gallery.is_some()).then(|| look_at_depth(dataset, &survey.views, session));
    problems.extend(depth.iter().flat_map(|depth| depth.findings(dataset, is_depth_used)));
    Ok(Preflight { args, dataset, survey, gallery, depth, memory, problems })
}

/// The settings that training would have.
fn config(args: &Info, dataset: &Dataset, gpu: Option<&Gpu>) -> Result<Config> {
    let options =
        TrainOptions { config: args.config.clone(), set: args.set.clone(), ..TrainOptions::default() };
    Ok(Settings::of(&options, dataset, gpu)?.config)
}

/// Reads all depth files, in parallel.
fn look_at_depth(dataset: &Dataset, views: &[usize], session: &Session<'_>) -> DepthSurvey {
    let views: Vec<usize> = views.iter().copied().filter(|&index| dataset.frames[index].has_depth).collect();
    let progress = Progress::new(session.console, "looking");
    DepthSurvey::of(dataset, &views, &|done| progress.count(done, views.len(), "depth files"))
}

/// Decodes all photos, in parallel, and keeps what matters of each, or why it cannot be trained on.
fn look(
    dataset: &Dataset,
    views: &[usize],
    parallax: &ParallaxSurvey,
    session: &Session<'_>,
) -> Result<(Gallery, Vec<Diagnostic>)> {
    let progress = Progress::new(session.console, "looking");
    let done = AtomicUsize::new(0);
    let looks: Result<Vec<_>> = (views.par_iter())
        .map(|&index| {
            session.check_interrupt()?;
            let look = dataset.load(index, false).map(|photo| {
                parallax.look(index, &photo);
                (index, Look::of(&photo))
            });
            progress.count(1 + done.fetch_add(1, Ordering::Relaxed), views.len(), "photos");
            let unreadable = |error| Unreadable { name: dataset.frames[index].name.clone(), error };
            match look {
                Err(error) if is_transient(&error) => Err(error),
                Err(error) => Ok(Err((index, unreadable(error)))),
                Ok(look) => Ok(Ok(look)),
            }
        })
        .collect();
    let (looks, failures): (Vec<_>, Vec<_>) = looks?.into_iter().partition(Result::is_ok);
    let looks = looks.into_iter().filter_map(Result::ok).collect();
    let (indices, failures): (Vec<_>, Vec<_>) = failures.into_iter().filter_map(Result::err).unzip();
    let problem = |kind: Kind| {
        Diagnostic::error(kind.message)
            .about(kind.members.into_iter().map(|member| indices[member]).collect())
    };
    Ok((Gallery { looks }, kinds(&failures, views.len(), "photos").into_iter().map(problem).collect()))
}

/// The result for what cannot even be opened.
fn unreadable(args: &Info, error: Error, session: &Session<'_>) -> Result<()> {
    if !session.global.json {
        return Err(error);
    }
    let message = with_flags(&error);
    let result = json!({
        "dataset": args.dataset.display().to_string(),
        "ok": false,
        "dialect": Value::Null,
        "frames": Value::Null,
        "found": Value::Null,
        "cameras": Value::Null,
        "box": Value::Null,
        "memory": Value::Null,
        "problems": [{ "severity": Severity::Error, "message": message }],
        "error": message,
    });
    session.print(&result, "")?;
    Err(error)
}
