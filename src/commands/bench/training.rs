//! `nerf bench training`: PSNR of test views against seconds of training.

mod curve;
mod psnr_plot;

use crate::cli::bench::Training;
use crate::commands::Session;
use crate::progress::short;
use anyhow::{Context, Result, ensure};
use curve::{Curve, follow};
use nerf::capture::dataset::{Dataset, OpenOptions};
use nerf::config::schedule::Budget;
use nerf::field::Field;
use nerf::field::trainer::Trainer;
use nerf::gpu::Gpu;
use nerf::run::results::{circumstances, joined, markdown, optional, quoted, write_csv, write_text};
use nerf::run::{Resolved, StepClock, Stepper, TrainOptions};
use nerf::support::file::write_json;
use nerf::support::lock::FolderLock;
use serde::Serialize;
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// What the seconds of training are.
const CLOCK: &str = "training alone, without loading, compiling and measuring; the steps of one block in sixteen wait \
                     for the device each, so that their stages can be timed";

/// One run to be measured.
struct PlannedRun {
    /// The stem of its config's file.
    config: String,
    resolved: Resolved,
}

/// One run that was measured.
#[derive(Serialize)]
struct MeasuredRun {
    config: String,
    seed: u32,
    /// Decoding the photos and putting them on the device.
    load_seconds: f64,
    /// Building kernels and buffers, and running each kernel once.
    compile_seconds: f64,
    /// Rendering and comparing test views, along the way and at the end.
    evaluate_seconds: f64,
    #[serde(flatten)]
    curve: Curve,
    /// All settings.
    settings: Arc<nerf::config::Config>,
}

/// What is the same in all runs.
struct Benchmark<'a> {
    gpu: Arc<Gpu>,
    dataset: &'a Dataset,
    views: usize,
}

pub(super) fn run(args: &Training, session: &Session<'_>) -> Result<()> {
    let dataset = Dataset::open(&args.dataset, &OpenOptions::default())?;
    session.console.notes(&dataset);
    ensure!(!dataset.test.is_empty(), "the dataset has no test views to measure; a benchmark needs some");
    let gpu = session.open_gpu()?;
    let planned = plan(args, &dataset, &gpu)?;
    session.end_gracefully()?;
    let _lock = FolderLock::alone(&args.out)?;
    let benchmark = Benchmark { gpu, dataset: &dataset, views: args.views as usize };
    let about = joined(
        circumstances(&benchmark.gpu),
        json!({
            "dataset": args.dataset.display().to_string(),
            "train_views": dataset.train.len(),
            "test_views": dataset.test.len(),
            "budget": planned.first().map(|run| run.resolved.metadata.budget),
            "clock": CLOCK,
        }),
    );
    let mut runs = Vec::new();
    for (number, next) in planned.iter().enumerate() {
        let seed = next.resolved.metadata.config.seed;
        session.console.say(&format!(
            "run {} of {}: {}, seed {seed}",
            number + 1,
            planned.len(),
            next.config
        ));
        let run = benchmark.run(next, session);
        runs.push(run.with_context(|| format!("{}, seed {seed}", next.config))?);
        // After every run: a benchmark that is interrupted keeps what it has.
        write(&args.out, &about, &runs)?;
    }
    session.print(&joined(about, json!({ "configs": summaries(&runs) })), &table(&runs))
}

/// Every config with every seed, all checked before any of them is run.
fn plan(args: &Training, dataset: &Dataset, gpu: &Gpu) -> Result<Vec<PlannedRun>> {
    let mut configs = Vec::new();
    for path in &args.config {
        let stem =
            path.file_stem().map_or_else(|| path.display().to_string(), |s| s.to_string_lossy().into_owned());
        ensure!(
            configs.iter().all(|(name, _)| *name != stem),
            "two configs are called '{stem}', and curves are named by their files; rename one of them"
        );
        configs.push((stem, Some(path.as_path())));
    }
    if configs.is_empty() {
        configs.push(("default".to_owned(), None));
    }
    let mut seeds: Vec<Option<u32>> = match args.seeds {
        Some(count) => (0..count).map(Some).collect(),
        None => args.seed.iter().copied().map(Some).collect(),
    };
    if seeds.is_empty() {
        seeds.push(None);
    }
    let dataset_name = args.dataset.display().to_string();
    let budget = Budget { steps: args.steps, seconds: args.seconds };
    let each = configs.iter().flat_map(|config| seeds.iter().map(move |&seed| (config, seed)));
    let run = |((name, config), seed): (&(String, Option<&Path>), Option<u32>)| {
        let options = TrainOptions {
            dataset: dataset_name.clone(),
            config: config.map(Path::to_owned),
            set: args.set.clone(),
            seed,
            budget,
            ..TrainOptions::default()
        };
        Ok(PlannedRun { config: name.clone(), resolved: Resolved::new_run(&options, dataset, gpu)? })
    };
    each.map(run).collect()
}

impl Benchmark<'_> {
    /// Trains and measures once.
    fn run(&self, planned: &PlannedRun, session: &Session<'_>) -> Result<MeasuredRun> {
        let resolved = &planned.resolved;
        let mut narrator = session.narrator();
        resolved.check_memory(&self.gpu, self.dataset, &resolved.test, false, &mut narrator)?;
        let clock = Instant::now();
        let views = resolved.photos(self.dataset).load(&self.gpu, &resolved.plan, &mut narrator)?;
        let load_seconds = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let mut trainer = Trainer::new(Field::new(&self.gpu, resolved.plan.clone())?, views)?;
        let evaluator = resolved.evaluator(&trainer, self.dataset, self.views)?;
        let mut evaluator = evaluator.context("the dataset has no test views")?;
        trainer.warm_up()?;
        let compile_seconds = clock.elapsed().as_secs_f64();
        let clock = Instant::now();
        let stepper = Stepper::new(trainer, StepClock::new(&resolved.metadata, 0.0));
        let curve = follow(stepper, &mut evaluator, &resolved.test, session)?;
        let settings = resolved.metadata.config.clone();
        Ok(MeasuredRun {
            config: planned.config.clone(),
            seed: settings.seed,
            load_seconds,
            compile_seconds,
            evaluate_seconds: clock.elapsed().as_secs_f64() - curve.seconds,
            curve,
            settings,
        })
    }
}

fn write(folder: &Path, about: &Value, runs: &[MeasuredRun]) -> Result<()> {
    let whole = joined(about.clone(), json!({ "configs": summaries(runs), "runs": runs }));
    write_json(&folder.join("training.json"), &whole)?;
    let rows = runs.iter().flat_map(|run| run.curve.points.iter().map(move |point| (run, point)));
    let rows = rows.map(|(run, point)| {
        let measured = point.measured;
        format!(
            "{},{},{},{:.6},{},{},{},{}",
            quoted(&run.config),
            run.seed,
            point.step,
            point.seconds,
            optional(point.loss),
            optional(measured.map(|m| m.eval_psnr)),
            optional(measured.map(|m| m.eval_ssim)),
            optional(measured.map(|m| m.views)),
        )
    });
    write_csv(&folder.join("training.csv"), "config,seed,step,seconds,loss,eval_psnr,eval_ssim,views", rows)?;
    write_text(&folder.join("training.svg"), &psnr_plot::plot(runs)?)
}

/// The runs of one config.
fn by_config(runs: &[MeasuredRun]) -> impl Iterator<Item = &[MeasuredRun]> {
    runs.chunk_by(|a, b| a.config == b.config)
}

/// Mean and sample standard deviation; the latter with two values or more.
fn spread(values: impl Iterator<Item = f64> + Clone) -> (f64, Option<f64>) {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count;
    let squares: f64 = values.map(|value| (value - mean).powi(2)).sum();
    (mean, (count > 1.0).then(|| (squares / (count - 1.0)).sqrt()))
}

fn summaries(runs: &[MeasuredRun]) -> Vec<Value> {
    let summary = |runs: &[MeasuredRun]| {
        let mean = |value: fn(&MeasuredRun) -> f64| spread(runs.iter().map(value)).0;
        let (psnr, psnr_spread) = spread(runs.iter().map(|run| run.curve.psnr));
        json!({
            "config": runs[0].config,
            "seeds": runs.iter().map(|run| run.seed).collect::<Vec<_>>(),
            "psnr": psnr,
            "psnr_deviation": psnr_spread,
            "ssim": mean(|run| run.curve.ssim),
            "steps": mean(|run| f64::from(run.curve.steps)),
            "seconds": mean(|run| run.curve.seconds),
            "samples_per_second": mean(|run| run.curve.samples_per_second),
            "load_seconds": mean(|run| run.load_seconds),
            "compile_seconds": mean(|run| run.compile_seconds),
            "evaluate_seconds": mean(|run| run.evaluate_seconds),
        })
    };
    by_config(runs).map(summary).collect()
}

fn table(runs: &[MeasuredRun]) -> String {
    let header = [
        "config",
        "seeds",
        "PSNR, dB",
        "SSIM",
        "seconds",
        "steps",
        "samples/s",
        "loading, s",
        "compiling, s",
        "measuring, s",
    ];
    let row = |runs: &[MeasuredRun]| {
        let mean = |value: fn(&MeasuredRun) -> f64| spread(runs.iter().map(value)).0;
        let (psnr, deviation) = spread(runs.iter().map(|run| run.curve.psnr));
        vec![
            runs[0].config.clone(),
            runs.len().to_string(),
            deviation.map_or_else(|| format!("{psnr:.2}"), |deviation| format!("{psnr:.2} ± {deviation:.2}")),
            format!("{:.4}", mean(|run| run.curve.ssim)),
            format!("{:.1}", mean(|run| run.curve.seconds)),
            format!("{:.0}", mean(|run| f64::from(run.curve.steps))),
            short(mean(|run| run.curve.samples_per_second)),
            format!("{:.1}", mean(|run| run.load_seconds)),
            format!("{:.1}", mean(|run| run.compile_seconds)),
            format!("{:.1}", mean(|run| run.evaluate_seconds)),
        ]
    };
    let rows: Vec<_> = by_config(runs).map(row).collect();
    markdown(&header, &rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads_are_sample_deviations() {
        assert_eq!(spread([2.0].into_iter()), (2.0, None));
        assert_eq!(spread([1.0, 2.0, 3.0].into_iter()), (2.0, Some(1.0)));
    }
}
