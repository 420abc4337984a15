//! Work and precision of the compositing kernels on rays whose integrals are known.

mod device;
pub(crate) mod medium;
pub(crate) mod order;
mod picture;

use super::{Outcome, say};
use anyhow::Result;
use clap::Args;
use device::{Device, Variant, name};
use medium::{Medium, Rms, Samples, phase};
use nerf::gpu::Gpu;
use nerf::run::results::{circumstances, joined, markdown, optional, write_csv, write_text};
use nerf::support::file::writable_folder;
use nerf::support::file::write_json;
use order::{Order, Point, order};
use rayon::prelude::*;
use serde::Serialize;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Powers of two: 4 to 1024 steps.
const POWERS: std::ops::RangeInclusive<u32> = 2..=10;
/// What f64 sums round to.
const DOUBLE_ROUNDING: f64 = 1e-14;

/// `quadrature`
#[derive(Args, Debug)]
pub(crate) struct Quadrature {
    /// Folder to write quadrature.json, quadrature.csv and quadrature.svg to
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Rays with different phases of their samples
    #[arg(long, value_name = "N", default_value = "4096", value_parser = clap::value_parser!(u32).range(1..=65_536))]
    rays: u32,
    /// Times that each batch is run; its time is the median
    #[arg(long, value_name = "N", default_value = "5", value_parser = clap::value_parser!(u32).range(1..=1000))]
    repeats: u32,
}

/// Errors and time of one variant, with one number of steps.
#[derive(Clone, Debug, Serialize)]
struct Row {
    medium: &'static str,
    transmittance: &'static str,
    early_stop: bool,
    steps: usize,
    /// Root mean square over rays and channels, of the kernel.
    color_error: f64,
    opacity_error: f64,
    /// The same of the f64 reference.
    color_error_f64: f64,
    opacity_error_f64: f64,
    /// Root mean square difference between the two: what f32 rounds.
    color_rounding: f64,
    opacity_rounding: f64,
    /// Samples per ray that were composited.
    kept_per_ray: f64,
    /// Of the device, for all rays: selecting samples, packing and compositing them, with gradients. `None` where
    /// the adapter has no timestamps.
    seconds: Option<f64>,
}

/// The order of an error, in the kernel's and in f64 arithmetic.
#[derive(Clone, Debug, Serialize)]
struct Measured {
    medium: &'static str,
    transmittance: &'static str,
    early_stop: bool,
    quantity: &'static str,
    kernel: Option<Order>,
    reference: Option<Order>,
}

pub(crate) fn run(args: &Quadrature, gpu: &Arc<Gpu>) -> Result<Outcome> {
    writable_folder(&args.out)?;
    let mut device = Device::new(gpu, args.rays as usize, 1 << POWERS.end(), args.repeats)?;
    let mut rows = Vec::new();
    for medium in Medium::ALL {
        say(&format!("integrating: {}", medium.description()));
        for power in POWERS {
            rows.extend(measure(&mut device, medium, 1 << power)?);
        }
    }
    let orders = orders(&rows);
    let about = joined(
        circumstances(gpu),
        json!({
            "rays": args.rays,
            "repeats": args.repeats,
            "stop_transmittance": device::STOP,
            "media": Medium::ALL.map(|medium| json!({
                "name": medium.name(),
                "description": medium.description(),
                "exact": medium.exact(),
                "largest_density": medium.densest(),
            })),
            "orders": orders,
        }),
    );
    write_json(&args.out.join("quadrature.json"), &joined(about.clone(), json!({ "rows": rows })))?;
    csv(&args.out.join("quadrature.csv"), &rows)?;
    write_text(&args.out.join("quadrature.svg"), &picture::picture(&rows)?)?;
    Ok(Outcome { json: about, text: table(&orders) })
}

/// All variants of one medium with one number of steps; the rays go through the device in chunks.
fn measure(device: &mut Device, medium: Medium, steps: usize) -> Result<Vec<Row>> {
    let rays = device.rays;
    let exact = medium.exact();
    // Rendered by the kernel and by the reference, of each variant.
    let mut rendered = vec![Vec::with_capacity(rays); Variant::ALL.len()];
    let (mut seconds, mut kept) =
        (vec![device.has_timer().then_some(0.0); rendered.len()], vec![0; rendered.len()]);
    for first in (0..rays).step_by(device.chunk(steps)) {
        let last = (first + device.chunk(steps)).min(rays);
        let samples: Vec<Samples> =
            (first..last).into_par_iter().map(|ray| Samples::new(medium, steps, phase(ray, rays))).collect();
        device.upload(&samples)?;
        for (index, variant) in Variant::ALL.into_iter().enumerate() {
            let outcome = device.render(index, &samples)?;
            let reference: Vec<_> =
                samples.par_iter().map(|ray| ray.render(variant.transmittance, variant.stop())).collect();
            rendered[index].extend(outcome.rendered.into_iter().zip(reference));
            seconds[index] = seconds[index].zip(outcome.seconds).map(|(sum, seconds)| sum + seconds);
            kept[index] += outcome.kept;
        }
    }
    let row = |(index, variant): (usize, Variant)| {
        let pairs = &rendered[index];
        let kernel = Rms::of(pairs.iter().map(|pair| (pair.0, exact)));
        let reference = Rms::of(pairs.iter().map(|pair| (pair.1, exact)));
        let rounding = Rms::of(pairs.iter().copied());
        Row {
            medium: medium.name(),
            transmittance: name(variant.transmittance),
            early_stop: variant.early_stop,
            steps,
            color_error: kernel.color,
            opacity_error: kernel.opacity,
            color_error_f64: reference.color,
            opacity_error_f64: reference.opacity,
            color_rounding: rounding.color,
            opacity_rounding: rounding.opacity,
            kept_per_ray: kept[index] as f64 / rays as f64,
            seconds: seconds[index],
        }
    };
    Ok(Variant::ALL.into_iter().enumerate().map(row).collect())
}

/// Whether a row is of a medium and a variant.
fn is_of(row: &Row, medium: Medium, variant: Variant) -> bool {
    let is_variant = row.transmittance == name(variant.transmittance) && row.early_stop == variant.early_stop;
    row.medium == medium.name() && is_variant
}

/// The order of every curve.
fn orders(rows: &[Row]) -> Vec<Measured> {
    let mut orders = Vec::new();
    for medium in Medium::ALL {
        for variant in Variant::ALL {
            let curve: Vec<_> = rows.iter().filter(|row| is_of(row, medium, variant)).collect();
            let of = |value: &dyn Fn(&Row) -> (f64, f64)| {
                let point = |row: &&Row| {
                    let (error, rounding) = value(row);
                    // An order is looked for above ten times this; a stop leaves out up to its threshold.
                    let stop = if row.kept_per_ray < row.steps as f64 { 0.1 * variant.stop() } else { 0.0 };
                    Point { steps: row.steps, error, rounding: rounding.max(stop) }
                };
                order(&curve.iter().map(point).collect::<Vec<_>>(), medium.densest())
            };
            let measured = |quantity, kernel, reference| Measured {
                medium: medium.name(),
                transmittance: name(variant.transmittance),
                early_stop: variant.early_stop,
                quantity,
                kernel,
                reference,
            };
            orders.push(measured(
                "color",
                of(&|row| (row.color_error, row.color_rounding)),
                of(&|row| (row.color_error_f64, DOUBLE_ROUNDING)),
            ));
            orders.push(measured(
                "opacity",
                of(&|row| (row.opacity_error, row.opacity_rounding)),
                of(&|row| (row.opacity_error_f64, DOUBLE_ROUNDING)),
            ));
        }
    }
    orders
}

fn csv(path: &Path, rows: &[Row]) -> Result<()> {
    let header = "medium,transmittance,early_stop,steps,color_error,opacity_error,color_error_f64,opacity_error_f64,\
                  color_rounding,opacity_rounding,kept_per_ray,seconds";
    let line = |row: &Row| {
        format!(
            "{},{},{},{},{:e},{:e},{:e},{:e},{:e},{:e},{},{}",
            row.medium,
            row.transmittance,
            row.early_stop,
            row.steps,
            row.color_error,
            row.opacity_error,
            row.color_error_f64,
            row.opacity_error_f64,
            row.color_rounding,
            row.opacity_rounding,
            row.kept_per_ray,
            optional(row.seconds)
        )
    };
    write_csv(path, header, rows.iter().map(line))
}

fn table(orders: &[Measured]) -> String {
    let header = [
        "medium",
        "sum",
        "early stop",
        "error of",
        "order, kernel",
        "order, f64",
        "steps, kernel",
        "steps, f64",
    ];
    let slope =
        |order: Option<Order>| order.map_or_else(|| "–".to_owned(), |order| format!("{:.2}", order.slope));
    let range =
        |order: Option<Order>| order.map_or_else(String::new, |order| format!("{}–{}", order.from, order.to));
    let row = |order: &Measured| {
        vec![
            order.medium.to_owned(),
            order.transmittance.to_owned(),
            if order.early_stop { "on" } else { "off" }.to_owned(),
            order.quantity.to_owned(),
            slope(order.kernel),
            slope(order.reference),
            range(order.kernel),
            range(order.reference),
        ]
    };
    let rows: Vec<_> = orders.iter().map(row).collect();
    format!(
        "{}\n\nOrders are slopes over the range of steps that follows: where no step is optically thicker than \
         1/2 and the error is ten times what rounding leaves, and above the threshold of a stop; – where that leaves \
         fewer than three points.",
        markdown(&header, &rows)
    )
}
