//! The curves as a plot.

use super::curve::Point;
use super::{MeasuredRun, by_config};
use anyhow::Result;
use nerf::support::chart::{Axis, Chart, Mark, Series};

/// Lines that a reader can tell apart.
const MOST_LINES: usize = 7;

/// PSNR of the test views measured along the way against seconds of training: a line for each run, or for each
/// config, with the means of its seeds, where those would be too many.
pub(super) fn plot(runs: &[MeasuredRun]) -> Result<String> {
    let configs = by_config(runs);
    let series = if runs.len() <= MOST_LINES {
        configs.flat_map(lines).collect()
    } else {
        configs.map(mean).collect()
    };
    let views = runs.first().and_then(|run| curve(run).next()).and_then(|point| point.measured);
    let views = views.map_or(0, |measured| measured.views);
    let chart = Chart {
        title: format!("Test PSNR against training time ({views} views)"),
        x: Axis::log("seconds of training"),
        y: Axis::linear("PSNR, dB"),
        series,
    };
    chart.svg(900, 560)
}

/// The points with as many views as the first measurement.
fn curve(run: &MeasuredRun) -> impl Iterator<Item = &Point> {
    let mut measured = run.curve.points.iter().filter_map(|point| point.measured);
    let views = measured.next().map(|measured| measured.views);
    run.curve.points.iter().filter(move |point| views.is_some() && point.measured.map(|m| m.views) == views)
}

fn coordinates(run: &MeasuredRun) -> Vec<(f64, f64)> {
    curve(run).filter_map(|point| Some((point.seconds, point.measured?.eval_psnr))).collect()
}

fn lines(runs: &[MeasuredRun]) -> Vec<Series> {
    let name = |run: &MeasuredRun| match runs.len() {
        1 => run.config.clone(),
        _ => format!("{}, seed {}", run.config, run.seed),
    };
    runs.iter().map(|run| Series::new(&name(run), Mark::LinePoints, coordinates(run))).collect()
}

fn mean(runs: &[MeasuredRun]) -> Series {
    let all: Vec<_> = runs.iter().map(coordinates).collect();
    let shortest = all.iter().map(Vec::len).min().unwrap_or(0);
    let count = all.len() as f64;
    let at = |index: usize| {
        let sum = all.iter().fold((0.0, 0.0), |sum, run| (sum.0 + run[index].0, sum.1 + run[index].1));
        (sum.0 / count, sum.1 / count)
    };
    let name = format!("{}, mean of {} seeds", runs[0].config, runs.len());
    Series::new(&name, Mark::LinePoints, (0..shortest).map(at).collect())
}
