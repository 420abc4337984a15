//! `nerf eval`: PSNR and SSIM against photos.

mod pictures;
mod save_folder;

use super::{Session, open_to_compare, warn_of_differences};
use crate::cli::Eval;
use crate::score_summary::describe_near;
use anyhow::{Context, Result, ensure};
use nerf::camera::LensKind;
use nerf::capture::dataset::Dataset;
use nerf::capture::image_file::write_png_rgba8;
use nerf::photo::Split;
use nerf::photo::color_space::{ColorSpace, opaque_srgb8};
use nerf::run::{Compared, Evaluator, Means, Score, TrainedField};
use nerf::support::fingerprint::checksum;
use nerf::support::format::{count, few};
use nerf::support::lock::FolderLock;
use save_folder::SaveFolder;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

pub(super) fn run(args: &Eval, session: &Session<'_>) -> Result<()> {
    let field = session.load_field(&args.run)?;
    let dataset = open_to_compare(&args.dataset, &args.reading, field.metadata())?;
    let indices = frames(&field, &dataset, args.split, session)?;
    warn_of_differences(field.metadata(), (&dataset, &indices), session)?;
    ensure!(
        dataset.is_hdr == field.metadata().features.hdr,
        "the field was trained on {} images, and {} has {} images; name the dataset it was trained on",
        range(field.metadata().features.hdr),
        args.dataset.display(),
        range(dataset.is_hdr)
    );
    let save =
        args.save.as_deref().map(|folder| save_to(folder, args, &field, (&dataset, &indices))).transpose()?;
    let gpu = session.open_gpu()?;
    let lenses = LensKind::among(indices.iter().map(|&index| &dataset.frames[index].camera));
    let mut evaluator = Evaluator::new(field.renderer(&gpu, &lenses)?, field.color_space(), &dataset);
    evaluator.background = args.background.color();
    evaluator.samples = args.spp;
    let files = save.as_ref().map_or(&[][..], |folder| &folder.files);
    let scores = measure(evaluator, &indices, files, session)?;
    let means = Means::of(&scores).context("there was nothing to measure")?;
    session.console.fog(means.near_share);
    session.print(&report(args, &field, &scores, means), &describe(args, &scores, means, field.color_space()))
}

/// Takes a folder for renderings of some frames.
fn save_to(
    folder: &Path,
    args: &Eval,
    field: &TrainedField,
    (dataset, indices): (&Dataset, &[usize]),
) -> Result<SaveFolder> {
    let lock = if args.overwrite { FolderLock::alone } else { FolderLock::shared };
    let lock = lock(folder)?;
    let files = pictures::paths(folder, dataset, indices)?;
    let frames = dataset.frames.iter().map(|frame| format!("{} {:?}", frame.name, frame.camera));
    let rendering = json!({
        "checkpoint": field.path().display().to_string(),
        "step": field.metadata().step,
        "field": field.identity(),
        "dataset": checksum(frames),
        "background": args.background.name(),
        "spp": args.spp,
    });
    let rendering = rendering.as_object().cloned().unwrap_or_default();
    SaveFolder::take((folder, lock), files, rendering, args.overwrite)
}

fn measure(
    mut evaluator: Evaluator<'_>,
    indices: &[usize],
    pictures: &[PathBuf],
    session: &Session<'_>,
) -> Result<Vec<Score>> {
    let mut scores = Vec::with_capacity(indices.len());
    session.end_gracefully()?;
    evaluator.each(indices, None, &mut session.narrator(), |position, compared| {
        let Compared { mut score, size: [width, height], rendered, .. } = compared;
        if let Some(picture) = pictures.get(position) {
            write_png_rgba8(picture, width, height, &opaque_srgb8(&rendered))?;
            score.saved = picture.file_name().map(|name| name.to_string_lossy().into_owned());
        }
        scores.push(score);
        Ok(())
    })?;
    Ok(scores)
}

/// The frames of a split as the run had it, else as the dataset has it.
fn frames(
    field: &TrainedField,
    dataset: &Dataset,
    split: Split,
    session: &Session<'_>,
) -> Result<Vec<usize>> {
    let names = field.metadata().splits.names(split);
    let (found, missing) = dataset.find(names);
    if found.is_empty() {
        let indices = dataset.split(split).to_vec();
        ensure!(
            !indices.is_empty(),
            "there are no {} views, neither in the checkpoint nor in the dataset",
            split.name()
        );
        session.console.warn(&format!(
            "none of the {} {} views of the run is in this dataset; its own {} are measured",
            names.len(),
            split.name(),
            indices.len()
        ));
        return Ok(indices);
    }
    if !missing.is_empty() {
        session.console.warn(&format!(
            "{} of {} {} views of the run are missing in this dataset: {}",
            missing.len(),
            names.len(),
            split.name(),
            few(&missing)
        ));
    }
    Ok(found)
}

/// What is to be said of the number of pixels, if it is not the whole photo.
fn remark(score: &Score) -> String {
    score.ignored.map_or(String::new(), |pixels| format!("  without {}", count(pixels, "masked pixel")))
}

fn range(hdr: bool) -> &'static str {
    if hdr { "linear" } else { "display-referred" }
}

fn report(args: &Eval, field: &TrainedField, scores: &[Score], means: Means) -> Value {
    json!({
        "psnr": means.psnr,
        "ssim": means.ssim,
        "near_share": means.near_share,
        "background": args.background.name(),
        "split": args.split.name(),
        "encoding": "sRGB, clamped to 0..1",
        "step": field.metadata().step,
        "seconds": field.metadata().seconds,
        "views": scores,
    })
}

fn describe(args: &Eval, scores: &[Score], means: Means, color_space: ColorSpace) -> String {
    let mut lines: Vec<_> = scores
        .iter()
        .map(|s| format!("{}  {:.3} dB  SSIM {:.4}{}", s.file, s.psnr, s.ssim, remark(s)))
        .collect();
    let encoding = if color_space == ColorSpace::Linear { ", sRGB-encoded and clamped" } else { "" };
    lines.push(format!(
        "mean of {} over {}{encoding}: {:.3} dB  SSIM {:.4}, {}",
        count(means.views, &format!("{} view", args.split.name())),
        args.background.name(),
        means.psnr,
        means.ssim,
        describe_near(means.near_share)
    ));
    lines.join("\n")
}
