//! `nerf report`: the page about a training, written by `nerf train` too.

use super::field::Field;
use super::scores::Judge;
use super::{Session, find_frames, open_to_compare};
use crate::cli::Report as Args;
use crate::remarks::Remarks;
use anyhow::{Context, Result, ensure};
use nerf::camera::LensKind;
use nerf::checkpoint::{self, About};
use nerf::dataset::Dataset;
use nerf::file::write_atomically;
use nerf::report::log::Log;
use nerf::report::pictures::{Pair, Pictures};
use nerf::report::views::TestViews;
use nerf::report::{FILE, Facts, Report};
use serde_json::json;
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
    let text = match report.result() {
        Some((psnr, ssim, count)) => {
            format!("PSNR {psnr:.3} dB, SSIM {ssim:.4} over {count} test views; {page}")
        }
        None => page.clone(),
    };
    let result = json!({
        "report": page,
        "views": report.views.as_ref().map_or(0, TestViews::count),
        "psnr": report.result().map(|(psnr, ..)| psnr),
        "ssim": report.result().map(|(_, ssim, _)| ssim),
        "steps": report.steps(),
        "seconds": report.seconds(),
        "skipped": report.log.skipped(),
        "without_views": report.views.as_ref().err(),
    });
    session.print(&result, &text)
}

/// Writes the page of a training that has just ended; where it is.
pub(super) fn after_training(run: &Path, about: &About, views: Result<TestViews, String>) -> Result<PathBuf> {
    let log = Log::read(&run.join(LOG))?;
    let facts = Facts { trained: Some(SystemTime::now()), ..facts(run, about)? };
    let out = run.join(FILE);
    save(&Report { facts, log, views }, &out)?;
    Ok(out)
}

/// Renders and scores frames, and keeps pictures of a few.
pub(super) fn measure(judge: &mut Judge<'_>, indices: &[usize], remarks: Remarks) -> Result<TestViews> {
    let mut views = TestViews::new(indices.len());
    judge.each(indices, remarks, |compared| {
        let (score, size) = (&compared.score, compared.size);
        let pair = Pair { size, rendered: &compared.rendered, photo: &compared.photo };
        views.add(&score.file, [score.psnr, score.ssim], || Pictures::new(&pair))
    })?;
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
    let mut judge = Judge {
        renderer: field.renderer(&gpu, &lenses)?,
        color_space: field.color_space(),
        background: [0.0; 3],
        dataset: &dataset,
    };
    let mut views = measure(&mut judge, &indices, session.remarks)?;
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
