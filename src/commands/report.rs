//! `nerf report`: the page about a training, written by `nerf train` too.

use super::field::Field;
use super::scores::{Compared, Judge, describe_near, warn_of_fog};
use super::{Session, find_frames, open_to_compare};
use crate::cli::Report as Args;
use crate::remarks::Remarks;
use anyhow::{Context, Result, ensure};
use nerf::camera::LensKind;
use nerf::capture::dataset::{Dataset, spread_order};
use nerf::field::checkpoint::{self, About};
use nerf::run::report::log::Log;
use nerf::run::report::pictures::{Pair, Pictures};
use nerf::run::report::views::{Outcome, TestViews};
use nerf::run::report::{FILE, Facts, Report};
use nerf::support::file::write_atomically;
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Files in the folder of a training.
const LOG: &str = "log.jsonl";
const CONFIG: &str = "config.json";

pub(super) fn run(args: &Args, session: &Session<'_>) -> Result<()> {
    let folder = folder(&args.run)?;
    let log = Log::read(&folder.join(LOG))?;
    let file = folder.join(checkpoint::FILE);
    let (facts, views) = if file.is_file() {
        let field = Field::load(&file, session)?;
        let trained = std::fs::metadata(&file).and_then(|data| data.modified()).ok();
        let views = views(args, &field, session)?;
        (Facts { trained, ..facts(&folder, &field.about)? }, views)
    } else {
        let reason = format!(
            "There is no {} yet: the training ended before it saved, so there is nothing to render.",
            checkpoint::FILE
        );
        let run = folder.display().to_string();
        let settings = std::fs::read_to_string(folder.join(CONFIG)).ok();
        (Facts { run, settings, ..Facts::default() }, Err(reason))
    };
    if let Err(reason) = &views {
        session.remarks.warn(reason);
    }
    let out = args.out.clone().unwrap_or_else(|| folder.join(FILE));
    let report = Report { facts, log, views };
    save(&report, &out)?;
    let page = out.display().to_string();
    let outcome = report.outcome();
    let text = outcome.map_or_else(|| page.clone(), |outcome| format!("{}; {page}", describe(&outcome)));
    let mut result = json!({
        "report": page,
        "steps": report.steps(),
        "seconds": report.seconds(),
        "skipped": report.log.skipped(),
        "without_views": report.views.as_ref().err(),
    });
    add_outcome(&mut result, outcome.as_ref());
    // What the log tells of them is no part of the page's pictures.
    result["views"] = json!(report.views.as_ref().map_or(0, TestViews::count));
    warn_of_fog(outcome.and_then(|outcome| outcome.near_share), session.remarks);
    session.print(&result, &text)
}

/// What the test views say, in words.
pub(super) fn describe(outcome: &Outcome) -> String {
    let Outcome { psnr, ssim, near_share, .. } = *outcome;
    let (measured, near) = (outcome.measured(), describe_near(near_share));
    format!("PSNR {psnr:.3} dB, SSIM {ssim:.4} over {measured} on black, {near}")
}

/// What the test views say, as entries of a result; null where nothing was measured.
pub(super) fn add_outcome(result: &mut Value, outcome: Option<&Outcome>) {
    result["psnr"] = json!(outcome.map(|outcome| outcome.psnr));
    result["ssim"] = json!(outcome.map(|outcome| outcome.ssim));
    result["near_share"] = json!(outcome.and_then(|outcome| outcome.near_share));
    result["background"] = json!(outcome.map(|_| "black"));
    result["views"] = json!(outcome.map_or(0, |outcome| outcome.views));
    result["views_left_out"] = json!(outcome.map_or(0, |outcome| outcome.left_out));
}

/// Writes the page of a training that has just ended; where it is.
pub(super) fn after_training(run: &Path, about: &About, views: Result<TestViews, String>) -> Result<PathBuf> {
    let log = Log::read(&run.join(LOG))?;
    let facts = Facts { trained: Some(SystemTime::now()), ..facts(run, about)? };
    let out = run.join(FILE);
    save(&Report { facts, log, views }, &out)?;
    Ok(out)
}

/// Renders and scores frames, and keeps pictures of a few. It takes about `limit` seconds at most: what it comes to
/// by then is evenly spaced.
pub(super) fn measure(
    judge: &mut Judge<'_>,
    indices: &[usize],
    limit: Option<f64>,
    remarks: Remarks,
) -> Result<TestViews> {
    let mut views = TestViews::default();
    let mut order = spread_order(indices.len());
    // Where only one fits it is one from the middle: the first of a capture is often easier than the others.
    order.rotate_left(1.min(indices.len()));
    let spread: Vec<usize> = order.iter().map(|&position| indices[position]).collect();
    let reached = judge.each(&spread, limit, remarks, |number, compared| {
        let Compared { score, size, rendered, photo, depth, unit } = &compared;
        let pair = Pair { size: *size, rendered, photo, depth, unit: *unit };
        views.add(order[number], score.for_page(), || Pictures::new(&pair))
    })?;
    views.left_out = indices.len() - reached;
    Ok(views)
}

/// The folder that `run`, itself or a checkpoint in it, stands for.
fn folder(run: &Path) -> Result<PathBuf> {
    let show = run.display();
    let folder = if run.is_file() { run.parent().unwrap_or(run) } else { run };
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let is_known = [checkpoint::FILE, LOG].into_iter().any(|file| folder.join(file).is_file());
    ensure!(
        is_known,
        "{show} has neither {} nor {LOG}; expected the folder that `nerf train --out` wrote",
        checkpoint::FILE
    );
    Ok(folder.to_owned())
}

fn facts(run: &Path, about: &About) -> Result<Facts> {
    Ok(Facts {
        run: run.display().to_string(),
        dataset: Some(about.dataset.clone()),
        trained: None,
        adapter: Some(about.adapter.clone()),
        steps: Some(u64::from(about.step)),
        seconds: Some(about.seconds),
        is_done: Some(about.budget.is_spent(about.step, about.seconds)),
        train_views: Some(about.splits.train.len()),
        hdr: about.needs.hdr,
        settings: Some(serde_json::to_string_pretty(&about.config)?),
    })
}

/// The test views, rendered from the checkpoint, or why they cannot be shown. A dataset that was named must be
/// there; the one trained on may have moved.
fn views(args: &Args, field: &Field, session: &Session<'_>) -> Result<Result<TestViews, String>> {
    let names = &field.about.splits.test;
    if names.is_empty() {
        return Ok(Err("The training held out no test views.".to_owned()));
    }
    let path = args.dataset.clone().unwrap_or_else(|| PathBuf::from(&field.about.dataset));
    let (dataset, indices, missing) = match open(&path, args, field) {
        Ok(found) => found,
        Err(error) if args.dataset.is_none() => {
            return Ok(Err(format!(
                "The test views are not shown: their dataset could not be used ({error:#}). If it has moved, say \
                 where it is: nerf report {} --dataset DATASET",
                args.run.display()
            )));
        }
        Err(error) => return Err(error),
    };
    let gpu = session.open_gpu()?;
    let lenses = LensKind::among(indices.iter().map(|&index| &dataset.frames[index].camera));
    let mut judge = Judge::new(field.renderer(&gpu, &lenses)?, field.color_space(), &dataset);
    let mut views = measure(&mut judge, &indices, None, session.remarks)?;
    views.missing = missing;
    Ok(Ok(views))
}

/// The dataset, its test views as the training had them, and the names of those that it lacks.
fn open(path: &Path, args: &Args, field: &Field) -> Result<(Dataset, Vec<usize>, Vec<String>)> {
    let dataset = open_to_compare(path, &args.reading, &field.about)?;
    let show = path.display();
    ensure!(
        dataset.is_hdr == field.about.needs.hdr,
        "{show} has images of another kind (display-referred or linear) than the training"
    );
    let (indices, missing) = find_frames(&dataset, &field.about.splits.test);
    let missing = missing.into_iter().map(str::to_owned).collect();
    ensure!(!indices.is_empty(), "none of the training's test views is in {show}");
    Ok((dataset, indices, missing))
}

fn save(report: &Report, out: &Path) -> Result<()> {
    let html = report.html()?;
    write_atomically(out, |file| Ok(file.write_all(html.as_bytes())?)).context("the report was not written")
}
