//! `nerf train`: a dataset becomes a checkpoint.

mod ignored;

use super::Session;
use crate::cli::Train;
use crate::flags::{message_with_flags, with_flags};
use crate::progress::duration;
use crate::score_summary;
use anyhow::{Context, Result};
use nerf::capture::dataset::{Dataset, OpenOptions};
use nerf::capture::diagnostics::Severity;
use nerf::capture::health::Survey;
use nerf::capture::health::depth::DepthSurvey;
use nerf::config::schedule::Budget;
use nerf::field::checkpoint::{Checkpoint, Metadata, Opened};
use nerf::run::memory::peak_bytes;
use nerf::run::report::test_views::TestViews;
use nerf::run::{
    EvaluationAtEnd, EvaluationOptions, NoTestViews, Resolved, RunFolder, SavingOptions, TrainOptions,
    TrainingEnd, TrainingRun,
};
use nerf::support::format::count;
use serde_json::json;

pub(super) fn run(args: &Train, session: &Session<'_>) -> Result<()> {
    let (folder, checkpoint) = folder(args, session)?;
    let dataset = open(args, checkpoint.as_ref(), session)?;
    let gpu = session.open_gpu()?;
    let options = options(args);
    let resolved = match checkpoint {
        None => Resolved::new_run(&options, &dataset, &gpu)?,
        Some(checkpoint) => {
            let earlier = checkpoint.metadata.clone();
            let resolved = Resolved::resume(&options, &dataset, &gpu, checkpoint)?;
            ignored::say(args, (&earlier, &resolved.metadata), &dataset, &folder, session);
            resolved
        }
    };
    if resolved.metadata.config.loss.depth > 0.0 {
        warn_of_depth(&dataset, &resolved.train, session);
    }
    let evaluation = EvaluationOptions {
        every: args.eval_every,
        at_end: match (args.no_eval, args.eval_all) {
            (true, _) => EvaluationAtEnd::Nothing,
            (_, true) => EvaluationAtEnd::All,
            _ => EvaluationAtEnd::Share,
        },
    };
    let saving = SavingOptions { every: args.checkpoint_every, keep: args.keep as usize };
    let mut narrator = session.narrator();
    let run = TrainingRun {
        gpu,
        dataset: &dataset,
        resolved,
        folder,
        evaluation,
        saving,
        overcommit: args.overcommit,
    };
    let mut training = run.begin(&mut narrator)?;
    session.end_gracefully()?;
    let end = training.train(&mut narrator)?;
    let folder = args.out.display().to_string();
    let saved = || format!("the run is saved to {folder}, but ");
    let views = training
        .evaluate(&end, &mut narrator)
        .with_context(|| saved() + "its test views were not measured")?;
    let views = views.map_err(|reason| without_views(reason, args));
    drop(narrator);
    let summary = views.as_ref().ok().and_then(TestViews::summary);
    let report = training.write_report(&end, views);
    let is_interrupted = session.check_interrupt().is_err();
    let mut result = json!({
        "run": folder,
        "steps": end.step,
        "steps_taken": end.step - training.metadata().step,
        "seconds": end.seconds,
        "loss": end.loss.map(|[_, last]| last),
        "skipped": end.skipped,
        "interrupted": is_interrupted,
        "memory": training.memory(),
    });
    let mut text = end_line(&end, training.metadata(), &folder);
    if is_interrupted && !end.interrupted {
        text = format!("interrupted when all steps were taken; {text}");
    }
    if let Some(summary) = summary {
        score_summary::add(&mut result, Some(&summary));
        text = format!("{}; {text}", score_summary::describe(&summary));
        if summary.left_out > 0 {
            text += &format!("; `nerf eval {folder} {}` measures all test views", args.dataset.display());
        }
        session.console.fog(summary.near_share);
    }
    match report {
        Ok(page) => result["report"] = json!(page.display().to_string()),
        Err(error) => session.console.warn(&format!("{}{}", saved(), with_flags(&error))),
    }
    result["memory"]["peak_bytes"] = json!(peak_bytes());
    session.print(&result, &text).with_context(|| format!("the run is saved to {folder}"))?;
    if is_interrupted {
        return session.check_interrupt();
    }
    training.finish_log().with_context(|| saved() + "its log lacks rows")
}

/// The folder to write to, and the run in it to go on with.
fn folder(args: &Train, session: &Session<'_>) -> Result<(RunFolder, Option<Checkpoint>)> {
    if args.resume || args.resume_or_start {
        let (folder, opened) = match args.resume {
            true => RunFolder::to_resume(&args.out).map(|(folder, opened)| (folder, Some(opened)))?,
            false => RunFolder::to_resume_or_start(&args.out)?,
        };
        let warning = opened.as_ref().and_then(Opened::warning);
        warning.iter().for_each(|warning| session.console.warn(warning));
        return Ok((folder, opened.map(|opened| opened.checkpoint)));
    }
    let folder = if args.overwrite { RunFolder::to_overwrite } else { RunFolder::unused };
    Ok((folder(&args.out)?, None))
}

/// The dataset, read as the command line says, else as before; what looks wrong with it is said.
fn open(args: &Train, checkpoint: Option<&Checkpoint>, session: &Session<'_>) -> Result<Dataset> {
    let earlier = checkpoint.map(|checkpoint| checkpoint.metadata.reading.clone());
    let reading = args.reading.over(earlier.unwrap_or_default());
    let options =
        OpenOptions { hold_out: args.hold_out.unwrap_or_default(), reading, ..OpenOptions::default() };
    let dataset = Dataset::open(&args.dataset, &options)?;
    session.console.notes(&dataset);
    let findings = Survey::of(&dataset).findings;
    for finding in findings.iter().filter(|finding| finding.severity < Severity::Note) {
        session.console.warn(&message_with_flags(&finding.message, finding.remedy.as_ref()));
    }
    Ok(dataset)
}

/// Says what looks wrong with the depth that is trained on, of a few frames; what fails is told on loading.
fn warn_of_depth(dataset: &Dataset, train: &[usize], session: &Session<'_>) {
    let with_depth: Vec<usize> =
        train.iter().copied().filter(|&index| dataset.frames[index].has_depth).collect();
    let survey = DepthSurvey::of_few(dataset, &with_depth);
    for finding in survey.findings(dataset, true) {
        if finding.severity == Severity::Warning {
            session.console.warn(&finding.message);
        }
    }
}

fn options(args: &Train) -> TrainOptions {
    TrainOptions {
        dataset: args.dataset.display().to_string(),
        config: args.config.clone(),
        set: args.set.clone(),
        seed: args.seed,
        background: args.background,
        deterministic: args.deterministic,
        budget: Budget { steps: args.steps, seconds: args.seconds },
    }
}

/// How the run went, in one line; `metadata` describes its beginning.
fn end_line(end: &TrainingEnd, metadata: &Metadata, folder: &str) -> String {
    let steps = count(end.step as usize, "step");
    if end.step == metadata.step && !end.interrupted {
        return format!(
            "no step was taken: the run in {folder} has had its {steps} in {}; give it more with --steps or --seconds",
            duration(end.seconds)
        );
    }
    let mut text = format!("{steps} in {}, saved to {folder}", duration(end.seconds));
    match end.skipped {
        0 => {}
        1 => text += "; 1 step was skipped, its gradients were not finite or far too large",
        skipped => {
            text +=
                &format!("; {skipped} steps were skipped, their gradients were not finite or far too large");
        }
    }
    if let Some([first, last]) =
        end.loss.filter(|[first, last]| metadata.step == 0 && last != first && *last > 0.5 * first)
    {
        text += &format!(
            "; the loss has {}, from {first:.4} to {last:.4}: give it more steps, or a smaller \
             optimizer.learning_rate than {}",
            if last > first { "risen" } else { "hardly fallen" },
            metadata.config.optimizer.learning_rate
        );
    }
    if end.interrupted {
        text = format!("interrupted after {text}; go on with --resume");
    }
    text
}

/// Why the page shows no test views.
fn without_views(reason: NoTestViews, args: &Train) -> String {
    let later = format!("`nerf report {}` renders them.", args.out.display());
    match reason {
        NoTestViews::NoneHeldOut => "The run held out no test views.".to_owned(),
        NoTestViews::Interrupted => {
            format!("The test views were not rendered, the run was interrupted; {later}")
        }
        NoTestViews::NotAsked => {
            format!("The test views were not rendered, as asked for by --no-eval; {later}")
        }
    }
}
