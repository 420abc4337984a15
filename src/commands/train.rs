//! `nerf train`: a dataset becomes a checkpoint.

mod course;
mod folder;
mod log;
pub(super) mod needs;
pub(super) mod pace;
pub(super) mod photos;
pub(super) mod setup;
pub(super) mod stages;

use super::exam::Exam;
use super::scores::warn_of_fog;
use super::{Session, report};
use crate::cli::Train;
use crate::progress::duration;
use anyhow::Result;
use course::{Course, End};
use folder::RunFolder;
use nerf::capture::dataset::{Dataset, OpenOptions};
use nerf::capture::health::{Severity, Survey};
use nerf::config::schedule::Budget;
use nerf::field::Field;
use nerf::field::checkpoint::About;
use nerf::field::train::Trainer;
use nerf::run::report::views::TestViews;
use nerf::support::file::writable_folder;
use pace::Pace;
use serde_json::json;
use setup::{Setup, Wishes};
use std::time::Instant;

/// Views that `--eval-every` looks at.
const FEW_VIEWS: usize = 4;
/// Measuring the test views at the end takes at most this part of the training's seconds, unless all are asked for.
const EVALUATION_SHARE: f64 = 0.1;

pub(super) fn run(args: &Train, session: &Session<'_>) -> Result<()> {
    let mut folder = RunFolder::inspect(args)?;
    let earlier = folder.checkpoint.as_ref().map(|checkpoint| checkpoint.about.reading.clone());
    let reading = args.reading.over(earlier.unwrap_or_default());
    let options = OpenOptions { hold_out: args.hold_out, reading, ..OpenOptions::default() };
    let dataset = Dataset::open(&args.dataset, &options)?;
    session.remarks.notes(&dataset);
    let findings = Survey::of(&dataset).findings;
    for finding in findings.iter().filter(|finding| finding.severity < Severity::Note) {
        session.remarks.warn(&finding.message);
    }
    let gpu = session.open_gpu()?;
    let wishes = Wishes {
        dataset: &args.dataset.display().to_string(),
        config: args.config.as_deref(),
        set: &args.set,
        seed: args.seed,
        background: args.background,
        deterministic: args.deterministic,
        budget: Budget { steps: args.steps, seconds: args.seconds },
    };
    let setup = Setup::new(&wishes, &dataset, &gpu, folder.checkpoint.take())?;
    setup.describe(&gpu, session.remarks);
    photos::check_memory(&setup, &dataset, &gpu, session.remarks)?;
    writable_folder(&args.out)?;
    let clock = Instant::now();
    let views = photos::load(&setup, &dataset, &gpu, session.remarks)?;
    let load_seconds = clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    let mut trainer = Trainer::new(Field::new(&gpu, setup.plan.clone())?, views)?;
    trainer.warm_up()?;
    if let Some(state) = &setup.state {
        trainer.restore(state)?;
    }
    let mut exam = None;
    if !args.no_eval || args.eval_every.is_some() {
        let few = if args.eval_every.is_some() { FEW_VIEWS } else { 0 };
        exam = Exam::new(&setup, trainer.field(), &dataset, few)?;
    }
    let compile_seconds = clock.elapsed().as_secs_f64();
    let mut log = folder.begin(&setup)?;
    log.write(&json!({
        "event": "start",
        "step": setup.about.step,
        "adapter": setup.about.adapter,
        "driver": format!("{} {}", gpu.info.driver, gpu.info.driver_info),
        "left_out": setup.plan.left_out(),
        "load_seconds": load_seconds,
        "compile_seconds": compile_seconds,
    }))?;
    // A deterministic training's checkpoint does not tell how long it took.
    let pace = Pace::new(&setup.about, trainer, setup.about.seconds.max(log.seconds));
    let mut course = Course::new(&setup.about, pace, log, folder.checkpoint_path(), session.remarks);
    (course.exam, course.eval_every) = (exam, args.eval_every);
    let end = course.run()?;
    finish(args, course, &end, &setup, session)
}

/// Measures the test views, unless the training was interrupted, writes the report and prints the result.
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
        "loss": end.loss.map(|[_, last]| last),
        "skipped": end.skipped,
        "interrupted": end.interrupted,
    });
    let mut text = summary(end, setup, &folder);
    let views = evaluate(args, &mut course, end, setup, session)?;
    if let Some(outcome) = views.as_ref().ok().and_then(TestViews::outcome) {
        report::add_outcome(&mut result, Some(&outcome));
        text = format!("{}; {text}", report::describe(&outcome));
        if outcome.left_out > 0 {
            text += &format!("; `nerf eval {folder} {}` measures all test views", args.dataset.display());
        }
        warn_of_fog(outcome.near_share, session.remarks);
    }
    let about = About { step: end.step, seconds: end.seconds, ..setup.about.clone() };
    match report::after_training(&args.out, &about, views) {
        Ok(page) => result["report"] = json!(page.display().to_string()),
        Err(error) => session.remarks.warn(&format!("the training is saved, but {error:#}")),
    }
    session.print(&result, &text)
}

/// How the training went, in one line.
fn summary(end: &End, setup: &Setup, folder: &str) -> String {
    let mut text = format!("{} steps in {}, saved to {folder}", end.step, duration(end.seconds));
    if end.skipped > 0 {
        text += &format!(
            "; {} steps were skipped, their gradients were not finite or far too large",
            end.skipped
        );
    }
    if let Some([first, last]) =
        end.loss.filter(|[first, last]| setup.about.step == 0 && last != first && *last > 0.5 * first)
    {
        text += &format!(
            "; the loss has hardly fallen, from {first:.4} to {last:.4}: give it more steps, or a smaller \
             optimizer.learning_rate than {}",
            setup.about.config.optimizer.learning_rate
        );
    }
    if end.interrupted {
        text = format!("interrupted after {text}; go on with --resume");
    }
    text
}

/// The scores of the test views, logged, or why there are none.
fn evaluate(
    args: &Train,
    course: &mut Course<'_>,
    end: &End,
    setup: &Setup,
    session: &Session<'_>,
) -> Result<Result<TestViews, String>> {
    let later = format!("`nerf report {}` renders them.", args.out.display());
    let exam = course.exam.take();
    let (Some(mut exam), false, false) = (exam, args.no_eval, end.interrupted) else {
        return Ok(Err(match (setup.test.is_empty(), end.interrupted) {
            (true, _) => "The training held out no test views.".to_owned(),
            (_, true) => format!("The test views were not rendered, the training was interrupted; {later}"),
            (_, false) => format!("The test views were not rendered, as asked for by --no-eval; {later}"),
        }));
    };
    let clock = Instant::now();
    // What is to be the same again must not depend on the clock.
    let is_limited = !args.eval_all && !setup.about.config.deterministic;
    let limit = is_limited.then_some(EVALUATION_SHARE * end.seconds);
    let views = report::measure(&mut exam.judge, &exam.test, limit, session.remarks)?;
    if let Some(outcome) = views.outcome() {
        course.log.write(&json!({
            "step": end.step,
            "seconds": end.seconds,
            "eval_psnr": outcome.psnr,
            "eval_ssim": outcome.ssim,
            "eval_seconds": clock.elapsed().as_secs_f64(),
            "views": outcome.views,
            "views_left_out": outcome.left_out,
            "near_share": outcome.near_share,
        }))?;
    }
    Ok(Ok(views))
}
