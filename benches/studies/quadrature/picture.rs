//! Errors against steps and against time, as a sheet of charts.

use super::device::{Variant, name};
use super::medium::Medium;
use super::{Row, is_of};
use anyhow::Result;
use nerf::support::chart::{Axis, Chart, Mark, Series};
use std::fmt::Write;

/// Of one chart, in pixels.
const WIDTH: u32 = 560;
const HEIGHT: u32 = 400;
/// Errors below this are not drawn: they are far below what f32 can show.
const LEAST_ERROR: f64 = 1e-9;

/// A chart for each medium and quantity: colour and opacity against the step, colour against time.
pub(crate) fn picture(rows: &[Row]) -> Result<String> {
    let mut charts = Vec::new();
    for medium in Medium::ALL {
        charts.push(against_step(rows, medium, "colour", |row| [row.color_error, row.color_error_f64]));
        charts.push(against_step(rows, medium, "opacity", |row| [row.opacity_error, row.opacity_error_f64]));
        charts.push(against_time(rows, medium));
    }
    sheet(&charts, 3)
}

fn against_step(rows: &[Row], medium: Medium, quantity: &str, errors: fn(&Row) -> [f64; 2]) -> Chart {
    let curve = |variant, which: usize| {
        let rows = rows.iter().filter(move |row| is_of(row, medium, variant));
        let points = rows.map(|row| (1.0 / row.steps as f64, errors(row)[which]));
        points.filter(|point| point.1 > LEAST_ERROR).collect()
    };
    let kernel = |variant: Variant| line(variant, Mark::Line, curve(variant, 0));
    let reference = |variant: Variant| {
        Series::new(&format!("{}, 64 bits", label(variant)), Mark::Points, curve(variant, 1))
    };
    let without_stop = Variant::ALL.into_iter().filter(|variant| !variant.early_stop);
    Chart {
        title: format!("{}: {quantity}", medium.description()),
        x: Axis::log("step, in lengths of the ray"),
        y: Axis::log("RMS error"),
        series: Variant::ALL.into_iter().map(kernel).chain(without_stop.map(reference)).collect(),
    }
}

fn against_time(rows: &[Row], medium: Medium) -> Chart {
    let curve = |variant| {
        let rows = rows.iter().filter(|row| is_of(row, medium, variant));
        let points = rows.filter_map(|row| Some((row.seconds? * 1e3, row.color_error))).collect();
        line(variant, Mark::LinePoints, points)
    };
    Chart {
        title: format!("{}: colour against time", medium.name()),
        x: Axis::log("milliseconds on the device, all rays"),
        y: Axis::log("RMS error"),
        series: Variant::ALL.into_iter().map(curve).collect(),
    }
}

/// Dashed with the early stop: most of it lies on the line without.
fn line(variant: Variant, mark: Mark, points: Vec<(f64, f64)>) -> Series {
    let series = Series::new(&label(variant), mark, points);
    if variant.early_stop { series.dashed() } else { series }
}

fn label(variant: Variant) -> String {
    let stop = if variant.early_stop { ", early stop" } else { "" };
    format!("{}{stop}", name(variant.transmittance))
}

/// Charts in rows of `columns` as one picture.
fn sheet(charts: &[Chart], columns: u32) -> Result<String> {
    let (width, height) = (columns * WIDTH, (charts.len() as u32).div_ceil(columns) * HEIGHT);
    let mut sheet = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} \
         {height}\">\n"
    );
    for (index, chart) in (0..).zip(charts) {
        let (x, y) = (index % columns * WIDTH, index / columns * HEIGHT);
        let picture = chart.svg(WIDTH, HEIGHT)?;
        write!(sheet, "<g transform=\"translate({x} {y})\">\n{picture}</g>\n")?;
    }
    Ok(sheet + "</svg>\n")
}
