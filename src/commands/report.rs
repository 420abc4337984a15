//! `nerf report`: the page about a training run, written by `nerf train` too.

use super::{Session, open_to_compare, warn_of_differences};
use crate::cli::Report as Args;
use crate::flags::with_flags;
use crate::score_summary;
use anyhow::{Result, ensure};
use nerf::camera::LensKind;
use nerf::capture::dataset::Dataset;
use nerf::field::checkpoint::locate;
use nerf::run::report::test_views::TestViews;
use nerf::run::report::{Facts, Report};
use nerf::run::{Evaluator, RunFolder, TrainedField};
use serde_json::json;
use std::path::{Path, PathBuf};

pub(super) fn run(args: &Args, session: &Session<'_>) -> Result<()> {
    let folder = RunFolder::find(&args.run)?;
    let log = folder.log()?;
    let (facts, views) = if locate(folder.path()).is_ok() {
        let field = session.load_field(folder.path())?;
        let trained = std::fs::metadata(field.path()).and_then(|data| data.modified()).ok();
        let views = views(args, &field, session)?;
        (Facts { trained, ..Facts::of(folder.path(), field.metadata())? }, views)
    } else {
        let reason = format!(
            "There is no {} yet: the run ended before it saved, so there is nothing to render.",
            RunFolder::CHECKPOINT
        );
        let run = folder.path().display().to_string();
        (Facts { run, settings: folder.config(), ..Facts::default() }, Err(reason))
    };
    if let Err(reason) = &views {
        session.console.warn(reason);
    }
    let out = args.out.clone().unwrap_or_else(|| folder.report());
    let report = Report { facts, log, views };
    report.save(&out)?;
    let page = out.display().to_string();
    let summary = report.summary();
    let text = summary
        .map_or_else(|| page.clone(), |summary| format!("{}; {page}", score_summary::describe(&summary)));
    let mut result = json!({
        "report": page,
        "steps": report.steps(),
        "seconds": report.seconds(),
        "skipped": report.log.skipped(),
        "without_views": report.views.as_ref().err(),
    });
    score_summary::add(&mut result, summary.as_ref());
    // What the log tells of them is no part of the page's pictures.
    result["views"] = json!(report.views.as_ref().map_or(0, TestViews::count));
    session.console.fog(summary.and_then(|summary| summary.near_share));
    session.print(&result, &text)
}

/// The test views, rendered from the checkpoint, or why they cannot be shown. A dataset that was named must be
/// there; the one trained on may have moved.
fn views(args: &Args, field: &TrainedField, session: &Session<'_>) -> Result<Result<TestViews, String>> {
    let names = &field.metadata().splits.test;
    if names.is_empty() {
        return Ok(Err("The run held out no test views.".to_owned()));
    }
    let path = args.dataset.clone().unwrap_or_else(|| PathBuf::from(&field.metadata().dataset));
    let (dataset, indices, missing) = match open(&path, args, field) {
        Ok(found) => found,
        Err(error) if args.dataset.is_none() => {
            return Ok(Err(format!(
                "The test views are not shown: their dataset could not be used ({}). If it has moved, say \
                 where it is: nerf report {} --dataset DATASET",
                with_flags(&error),
                args.run.display()
            )));
        }
        Err(error) => return Err(error),
    };
    warn_of_differences(field.metadata(), (&dataset, &indices), session)?;
    let gpu = session.open_gpu()?;
    let lenses = LensKind::among(indices.iter().map(|&index| &dataset.frames[index].camera));
    let mut evaluator = Evaluator::new(field.renderer(&gpu, &lenses)?, field.color_space(), &dataset);
    let mut views = TestViews::measure(&mut evaluator, &indices, None, &mut session.narrator())?;
    views.missing = missing;
    Ok(Ok(views))
}

/// The dataset, its test views as the run had them, and the names of those that it lacks.
fn open(path: &Path, args: &Args, field: &TrainedField) -> Result<(Dataset, Vec<usize>, Vec<String>)> {
    let dataset = open_to_compare(path, &args.reading, field.metadata())?;
    let show = path.display();
    ensure!(
        dataset.is_hdr == field.metadata().features.hdr,
        "{show} has images of another kind (display-referred or linear) than the run"
    );
    let (indices, missing) = dataset.find(&field.metadata().splits.test);
    let missing = missing.into_iter().map(str::to_owned).collect();
    ensure!(!indices.is_empty(), "none of the run's test views is in {show}");
    Ok((dataset, indices, missing))
}
