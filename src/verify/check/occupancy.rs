//! The occupancy grid's update.

use super::inputs::{Random, quiet_step, uniform};
use super::{CheckResult, CheckedAdapter, Setup, Workbench, visible_cells};
use crate::field::{Step, dimension, occupancy};
use crate::verify::reference::grid::grid_encode;
use crate::verify::reference::model::Model;
use crate::verify::reference::occupancy::{OccupancyShape, UNSEEN, bits, fade, is_set, threshold, visit};
use anyhow::Result;
use glam::DVec3;

/// Values and bits of the cells after visits to some of them, in one cascade and in three.
///
/// # Errors
/// When the device was lost or refuses a kernel.
pub fn occupancy_update(adapter: &CheckedAdapter) -> Result<CheckResult> {
    let mut result = CheckResult::new(
        "occupancy",
        2e-5,
        "e^s turns the rounding of a log-density of up to 15 into a relative one",
    );
    for (cascades, limit) in [(1, 0.01), (3, 1e6)] {
        let mut setup = Setup::tiny().cascades(cascades);
        setup.config.batch.samples = 1000;
        setup.config.occupancy.threshold = limit;
        setup.config.occupancy.decay = 0.9;
        let bench = adapter.workbench(setup)?;
        let mut random = Random::new(60);
        bench.randomise(&mut random, 1.0, 2.0)?;
        let mut update = occupancy::Update::new(&bench.gpu, &bench.plan, &bench.workspace)?;
        let want = visited(&bench, &mut update, &mut random)?;
        bench.run(update.bits())?;
        compare(&mut result, &bench, &want, limit)?;
    }
    Ok(result)
}

/// Visits cells on the device in chunks of odd sizes and strides, the last one up to the end of the grid; returns
/// the reference's values.
fn visited(bench: &Workbench, update: &mut occupancy::Update, random: &mut Random) -> Result<Vec<f64>> {
    let first: Vec<f32> = (0..bench.plan.cell_count())
        .map(|cell| match cell % 5 {
            0 => UNSEEN as f32,
            1 => 0.0,
            _ => random.number(0.0, 0.1) as f32,
        })
        .collect();
    bench.write("occupancy", &first);
    let mut want: Vec<f64> = first.iter().map(|&value| f64::from(value)).collect();
    let model = bench.model()?;
    let visible = visible_cells(&bench.plan);
    for (first_cell, stride, count) in [(0, 1, 1), (7, 3, 130), (2, 3, 1000), (visible.len() - 65, 1, 65)] {
        bench.set_step(Step {
            first_cell: first_cell as u32,
            cell_stride: stride as u32,
            cell_count: count as u32,
            ..quiet_step()
        });
        bench.run(update.chunk(count))?;
        for cell in (0..count).map(|i| visible[first_cell + i * stride] as usize) {
            want[cell] = value_of(bench, &model, cell, want[cell]);
        }
    }
    Ok(want)
}

/// The reference's value of a cell after a visit.
fn value_of(bench: &Workbench, model: &Model, cell: usize, old: f64) -> f64 {
    let plan = &bench.plan;
    let shape =
        OccupancyShape { cascades: plan.space.cascades() as u32, resolution: plan.config.occupancy.cells };
    let offset = [0, 1, 2].map(|axis| uniform(cell, dimension::CELL + axis));
    let position = shape.position(cell, DVec3::from_array(offset));
    let encoded = grid_encode(&model.levels, &model.table, position);
    let outputs = model.density.forward(&encoded).pop().unwrap_or_default();
    let raw = outputs.first().copied().unwrap_or(0.0);
    visit(old, raw, plan.least_step())
}

fn compare(result: &mut CheckResult, bench: &Workbench, want: &[f64], limit: f64) -> Result<()> {
    let cells = want.len();
    let cascades = bench.plan.space.cascades();
    let got: Vec<f32> = bench.read("occupancy", cells)?;
    // Values of a tenth and more; those below are visited from a position whose rounding counts.
    let faded: Vec<f64> = want.iter().map(|&value| fade(value, bench.plan.config.occupancy.decay)).collect();
    result.each(&format!("value, {cascades} cascades"), &got, &faded, |cell| want[cell].abs().max(0.05));
    let unseen = got.iter().step_by(5).all(|&value| value == UNSEEN as f32);
    result.holds(unseen, || "cells that no camera sees".into());
    let mean: Vec<f32> = bench.read("occupancy_mean", 1)?;
    let seen = want.iter().filter(|&&value| value >= 0.0);
    let want_mean = seen.clone().sum::<f64>() / seen.count() as f64;
    result.each("mean of the seen cells", &mean, &[want_mean], |_| want_mean);
    let limit = threshold(want, limit);
    result.holds((limit < 0.5 * want_mean) == (cascades == 1), || {
        "one case by the limit, one by the mean".into()
    });
    let (got, bits) = (bench.read::<u32>("occupancy_bits", cells / 32)?, bits(want, limit));
    let mut set = 0;
    for cell in (0..cells).filter(|&cell| (want[cell] / limit - 1.0).abs() > 1e-4) {
        let same = is_set(&got, cell) == is_set(&bits, cell);
        result.holds(same, || format!("bit of cell {cell}, value {}", want[cell]));
        set += usize::from(is_set(&got, cell));
    }
    result.holds(set > 0 && set < cells, || format!("{set} of {cells} cells are occupied"));
    Ok(())
}
