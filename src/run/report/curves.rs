//! The curves of a training run.

use crate::run::log::{Interval, Log, Steps};
use crate::support::chart::{Axis, Chart, Mark, Series};
use crate::support::format;

/// Width and height of a chart in pixels; the page scales it.
pub(super) const SIZE: [u32; 2] = [440, 280];

const TIME: &str = "seconds of training";
const KEPT: &str = "kept: with colour and gradients";

/// The charts that the log has data for.
pub(super) fn charts(log: &Log) -> Vec<Chart> {
    let all =
        [quality(log), loss(log), speed(log), rays(log), samples(log), per_ray(log), learning_rate(log)];
    all.into_iter().filter(|chart| chart.series.iter().any(|series| !series.points.is_empty())).collect()
}

/// PSNR of test views, one series per number of views, and of the rays trained on.
fn quality(log: &Log) -> Chart {
    let mut counts: Vec<u64> = log.evaluations.iter().map(|row| row.views).collect();
    counts.sort_unstable();
    counts.dedup();
    let mut series = vec![of_rows(log, "rays trained on", |row| row.psnr)];
    for count in counts {
        let rows = log.evaluations.iter().filter(|row| row.views == count);
        let points = rows.filter_map(|row| Some((row.seconds?, row.eval_psnr?))).collect();
        series.push(Series::new(&format::count(count as usize, "test view"), Mark::LinePoints, points));
    }
    chart("PSNR", Axis::linear("PSNR, dB"), series)
}

fn loss(log: &Log) -> Chart {
    chart("Loss", Axis::log("loss"), vec![of_rows(log, "loss", |row| row.loss)])
}

fn speed(log: &Log) -> Chart {
    let series = of_intervals(log, "samples/s", |interval| Some(interval.row.samples? / interval.elapsed));
    chart("Samples with gradients per second", Axis::linear("samples/s"), vec![series])
}

fn rays(log: &Log) -> Chart {
    let series = of_intervals(log, "rays", |interval| Some(interval.row.rays? / interval.steps));
    chart("Rays per step", Axis::linear("rays per step"), vec![series])
}

fn samples(log: &Log) -> Chart {
    let marched = of_intervals(log, "marched", |interval| Some(interval.row.marched? / interval.steps));
    let kept = of_intervals(log, KEPT, |interval| Some(interval.row.samples? / interval.steps));
    chart("Samples per step", Axis::log("samples per step"), vec![marched, kept])
}

/// Samples of a ray: many marched ones tell of space that is not known to be empty, many kept ones of a field that
/// is not solid.
fn per_ray(log: &Log) -> Chart {
    let per_ray = |samples: Option<f64>, row: &Steps| Some(samples? / row.rays.filter(|rays| *rays > 0.0)?);
    let of = |name, samples: fn(&Steps) -> Option<f64>| {
        let points = log.steps.iter().filter_map(|row| Some((row.seconds?, per_ray(samples(row), row)?)));
        Series::new(name, Mark::Line, points.collect())
    };
    let series = vec![of("marched", |row| row.marched), of(KEPT, |row| row.samples)];
    chart("Samples per ray", Axis::log("samples per ray"), series)
}

fn learning_rate(log: &Log) -> Chart {
    let series = of_rows(log, "learning rate", |row| row.learning_rate);
    chart("Learning rate", Axis::linear("learning rate"), vec![series])
}

fn chart(title: &str, y: Axis, series: Vec<Series>) -> Chart {
    Chart { title: title.to_owned(), x: Axis::linear(TIME), y, series }
}

fn of_rows(log: &Log, name: &str, value: fn(&Steps) -> Option<f64>) -> Series {
    let points = log.steps.iter().filter_map(|row| Some((row.seconds?, value(row)?)));
    Series::new(name, Mark::Line, points.collect())
}

fn of_intervals(log: &Log, name: &str, value: fn(Interval<'_>) -> Option<f64>) -> Series {
    let points = log.intervals().filter_map(|interval| Some((interval.row.seconds?, value(interval)?)));
    Series::new(name, Mark::Line, points.collect())
}
