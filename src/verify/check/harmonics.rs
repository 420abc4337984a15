//! The colour network's input: features as they are, and harmonics of the direction.

use super::inputs::Random;
use super::{CheckResult, CheckedAdapter, Setup};
use crate::field::layout::{COLOR_INPUTS, DENSITY_OUTPUTS};
use crate::field::{Counters, color, dispatch};
use crate::verify::reference::harmonics::harmonics as reference;
use anyhow::Result;
use glam::DVec3;

/// All terms of the harmonics, through the kernel that makes the colour network's input.
///
/// # Errors
/// When the device was lost or refuses the kernel.
pub fn harmonics(adapter: &CheckedAdapter) -> Result<CheckResult> {
    let mut result = CheckResult::new("harmonics", 1.8e-7, "three roundings of terms of up to 1");
    let bench = adapter.workbench(Setup::tiny())?;
    let mut random = Random::new(42);
    let directions = directions(&mut random, bench.plan.config.batch.rays);
    let count = directions.len();
    let features = random.numbers(count * DENSITY_OUTPUTS, -1e3, 1e3);
    let rows: Vec<_> = (0..count as u32).map(|ray| [(ray * 7) % count as u32, ray]).collect();
    let lines: Vec<_> = directions.iter().map(|d| [[0.0; 4], d.as_vec3().extend(1.0).to_array()]).collect();
    bench.set_rays_along(&lines);
    bench.write("density_out", &features);
    bench.write("kept_rows", &rows);
    bench.set_counters(Counters { kept: count as u32, ..Counters::default() });
    bench.workspace.set_dispatch(&bench.gpu, dispatch::KEPT, count);
    let stages = color::stages(&bench.gpu, &bench.plan, &bench.workspace, color::SelectionMode::Training)?;
    bench.run_only(&stages, "color input")?;
    let inputs: Vec<f32> = bench.read("color_input", count * COLOR_INPUTS)?;
    for (ray, (input, direction)) in inputs.chunks_exact(COLOR_INPUTS).zip(&directions).enumerate() {
        let (copied, terms) = input.split_at(DENSITY_OUTPUTS);
        let sample = rows[ray][0] as usize * DENSITY_OUTPUTS;
        result.holds(copied == &features[sample..sample + DENSITY_OUTPUTS], || {
            format!("features of ray {ray}")
        });
        // No term is much larger than 1, nor what is summed in it.
        result.each(&format!("direction {direction}"), terms, &reference(*direction), |_| 1.0);
    }
    Ok(result)
}

/// Unit vectors: along axes and diagonals, nearly so, and anywhere.
fn directions(random: &mut Random, count: usize) -> Vec<DVec3> {
    let mut directions = Vec::new();
    for x in [-1.0, 0.0, 1e-4, 1.0] {
        for y in [-1.0, 0.0, 1.0] {
            for z in [-1.0, 0.0, 1.0] {
                directions.extend(DVec3::new(x, y, z).try_normalize());
            }
        }
    }
    directions.resize_with(count, || random.direction());
    directions.iter().map(|direction| direction.as_vec3().as_dvec3()).collect()
}
