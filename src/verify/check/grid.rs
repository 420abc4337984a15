//! The hash grid's features.

use super::inputs::Random;
use super::{CheckResult, CheckedAdapter, Setup, Workbench};
use crate::field::density;
use crate::field::layout::FEATURES;
use crate::gpu::pass::Stage;
use crate::verify::reference::grid::grid_encode;
use crate::verify::reference::model::{RaySample, TrainingRay};
use anyhow::Result;
use glam::DVec3;

/// Features of positions everywhere, in coarse and in fine grids, of dense and of hashed levels.
///
/// # Errors
/// When the device was lost or refuses a kernel.
pub fn features(adapter: &CheckedAdapter) -> Result<CheckResult> {
    let mut result =
        CheckResult::new("hash grid: features", 3.6e-7, "a position in cells rounds to half a unit per axis");
    for finest in [40, 2048] {
        let mut setup = Setup::tiny();
        setup.config.grid.finest = finest;
        let bench = adapter.workbench(setup)?;
        let mut random = Random::new(10);
        let table = random.numbers(bench.plan.layout.entries * FEATURES, -1.0, 1.0);
        bench.set_table(&table);
        let table: Vec<f64> = table.iter().map(|&x| f64::from(x)).collect();
        let stages = density::stages(&bench.gpu, &bench.plan, &bench.workspace)?;
        let levels = bench.levels();
        result
            .holds(levels.iter().any(|level| level.dense) && levels.iter().any(|level| !level.dense), || {
                "levels of both kinds".into()
            });
        for count in [0, 1, 3, 65, 130, 500] {
            let positions = positions(&mut random, count);
            let case = format!("{count} samples, finest {finest}");
            let got = encode(&bench, &stages, &positions)?;
            for (position, got) in positions.iter().zip(got.chunks_exact(levels.len() * FEATURES)) {
                let want = grid_encode(&levels, &table, *position);
                // Entries are up to 1; a weight is a difference of positions in cells.
                let size = |i: usize| 1.0 + f64::from(levels[i / FEATURES].resolution);
                result.each(&format!("{case}, at {position}"), got, &want, size);
            }
        }
    }
    Ok(result)
}

/// The device's features of `positions`, `[positions, levels · 2]`; `stages` are those of [`density::stages`].
///
/// # Errors
/// When the device was lost.
pub fn encode(bench: &Workbench, stages: &[Stage], positions: &[DVec3]) -> Result<Vec<f32>> {
    bench.upload(&[one_ray(positions)])?;
    bench.run_only(stages, "encode")?;
    bench.read("encoding", positions.len() * bench.plan.layout.encoding())
}

/// Positions inside, on the borders of cells and of the box, and far outside.
pub fn positions(random: &mut Random, count: usize) -> Vec<DVec3> {
    let special = [0.0, 1.0, 0.25, 0.5, 1.0 - f64::from(f32::EPSILON) / 2.0, -0.25, 1.25, -1e30, 1e30, 1e-30];
    (0..count)
        .map(|i| match i % 4 {
            0 => random.vector(0.0, 1.0),
            1 => random.vector(-0.1, 1.1),
            2 => DVec3::splat(special[i / 4 % special.len()]),
            _ => DVec3::from_array([i, i / 3, i / 5].map(|i| special[i % special.len()])),
        })
        .map(|position| position.as_vec3().as_dvec3())
        .collect()
}

/// A ray whose samples lie at `positions`.
fn one_ray(positions: &[DVec3]) -> TrainingRay {
    let sample = |&position| RaySample { position, delta: 0.1, gains: [1.0; 2], distance: 0.0 };
    TrainingRay {
        direction: DVec3::Z,
        samples: positions.iter().map(sample).collect(),
        target: [0.0; 4],
        background: [0.0; 3],
        depth: 0.0,
    }
}
