//! `nerf train`: a dataset becomes a checkpoint.

mod course;
mod folder;
mod log;
mod setup;
mod stages;

use super::scores::{Judge, Means};
use super::{Session, writable_folder};
use crate::cli::Train;
use crate::progress::{Progress, duration};
use anyhow::Result;
use course::{Course, End, Exam};
use folder::RunFolder;
use nerf::dataset::{Dataset, OpenOptions};
use nerf::gpu::Gpu;
use nerf::picture::ColorSpace;
use nerf::render::Renderer;
use nerf::train::{Trainer, Views};
use serde_json::{Value, json};
use setup::Setup;
use std::sync::Arc;
use std::time::Instant;

/// Views that `--eval-every` looks at.
const FEW_VIEWS: usize = 4;

pub(super) fn run(args: &Train, session: &Session<'_>) -> Result<()> {
    let mut folder = RunFolder::inspect(args)?;
    let options = OpenOptions { hold_out: args.hold_out, ..OpenOptions::default() };
    let dataset = Dataset::open(&args.dataset, &options)?;
    session.remarks.notes(&dataset);
    let gpu = session.open_gpu()?;
    let setup = Setup::new(args, &dataset, &gpu, folder.checkpoint.take())?;
    setup.describe(&dataset, &gpu, session.remarks);
    writable_folder(&args.out)?;
    let clock = Instant::now();
    let images = {
        let progress = Progress::new(session.remarks, "loading");
        let count = setup.train.len();
        dataset.load_images(&setup.train, &|done| progress.count(done, count, "images"))?
    };
    let load_seconds = clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    let views = Views { cameras: &setup.cameras, images: &images, bounds: &setup.about.bounds };
    let mut trainer = Trainer::new(&gpu, setup.plan.clone(), &views)?;
    drop(images);
    trainer.warm_up()?;
    if let Some(state) = &setup.state {
        trainer.restore(state)?;
    }
    let exam = exam(args, &setup, &trainer, &dataset, &gpu)?;
    let compile_seconds = clock.elapsed().as_secs_f64();
    let mut log = folder.begin(&setup)?;
    log.write(&json!({
        "event": "start",
        "step": setup.about.step,
        "adapter": setup.about.adapter,
        "driver": format!("{} {}", gpu.info.driver, gpu.info.driver_info),
        "left_out": setup.left_out(&dataset),
        "load_seconds": load_seconds,
        "compile_seconds": compile_seconds,
    }))?;
    let mut course = Course::new(&setup.about, trainer, log, folder.checkpoint_path(), session.remarks);
    course.exam = exam;
    let end = course.run()?;
    finish(args, course, &end, &setup, session)
}

/// Renders test views while training or afterwards, if there are any and somebody wants to know.
fn exam<'a>(
    args: &Train,
    setup: &Setup,
    trainer: &Trainer,
    dataset: &'a Dataset,
    gpu: &Arc<Gpu>,
) -> Result<Option<Exam<'a>>> {
    if setup.test.is_empty() || (args.no_eval && args.eval_every.is_none()) {
        return Ok(None);
    }
    let needs = &setup.about.needs;
    let renderer = Renderer::new(gpu, &setup.plan, trainer.workspace(), &setup.about.bounds, needs.lens)?;
    let color_space = ColorSpace::of(needs.hdr);
    let judge = Judge { renderer, color_space, background: [0.0; 3], dataset };
    let mut few = Vec::new();
    if args.eval_every.is_some() {
        let count = setup.test.len().min(FEW_VIEWS);
        few = (0..count).map(|i| setup.test[i * setup.test.len() / count]).collect();
    }
    let images = dataset.load_images(&few, &|_| {})?;
    Ok(Some(Exam { judge, every: args.eval_every, few: few.into_iter().zip(images).collect() }))
}

/// Measures all test views, unless the training was interrupted, and prints the result.
fn finish(
    args: &Train,
    mut course: Course<'_>,
    end: &End,
    setup: &Setup,
    session: &Session<'_>,
) -> Result<()> {
    let folder = args.out.display().to_string();
    let mut result = json!({
        "run": folder,
        "steps": end.step,
        "seconds": end.seconds,
        "loss": end.loss,
        "skipped": end.skipped,
        "interrupted": end.interrupted,
    });
    let mut text = format!("{} steps in {}, saved to {folder}", end.step, duration(end.seconds));
    if end.skipped > 0 {
        text += &format!(
            "; {} steps were skipped, their gradients were not finite or far too large",
            end.skipped
        );
    }
    if end.interrupted {
        text = format!("interrupted after {text}; go on with --resume");
        return session.print(&result, &text);
    }
    let exam = course.exam.take().filter(|_| !args.no_eval);
    if let Some(means) = exam.map(|exam| all_views(exam.judge, &setup.test, session)).transpose()?.flatten() {
        let (psnr, ssim, views) = (means.psnr, means.ssim, means.views);
        course.log.write(&json!({
            "step": end.step,
            "seconds": end.seconds,
            "eval_psnr": psnr,
            "eval_ssim": ssim,
            "views": views,
        }))?;
        result["psnr"] = json!(psnr);
        result["ssim"] = json!(ssim);
        result["background"] = Value::from("black");
        result["views"] = json!(views);
        text = format!("PSNR {psnr:.3} dB, SSIM {ssim:.4} over {views} test views on black; {text}");
    }
    session.print(&result, &text)
}

fn all_views(mut judge: Judge<'_>, test: &[usize], session: &Session<'_>) -> Result<Option<Means>> {
    let progress = Progress::new(session.remarks, "measuring");
    let mut scores = Vec::with_capacity(test.len());
    for (number, &index) in test.iter().enumerate() {
        scores.push(judge.load_and_score(index)?.0);
        progress.count(number + 1, test.len(), "test views");
    }
    Ok(Means::of(&scores))
}
