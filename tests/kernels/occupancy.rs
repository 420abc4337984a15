//! The occupancy grid's update.

use glam::DVec3;
use nerf::kernels::{Step, occupancy};
use nerf::model::DENSITY_OUTPUTS;
use nerf::reference::grid::grid_encode;
use nerf::reference::occupancy::{OccupancyShape, UNSEEN, bits, threshold, visit};

use crate::bench::{Bench, Random, Setup, dimension, quiet_step, uniform, visible_cells};
use crate::close::assert_close;

/// The reference's value of a cell after a visit.
fn visited(bench: &Bench, cell: usize, old: f64, model: &nerf::reference::model::Model) -> f64 {
    let plan = &bench.plan;
    let shape = OccupancyShape { cascades: plan.needs.cascades, resolution: plan.config.occupancy.cells };
    let offset = [0, 1, 2].map(|axis| uniform(cell, dimension::CELL + axis));
    let position = shape.position(cell, DVec3::from_array(offset));
    let outputs = model.density.forward(&grid_encode(&model.levels, &model.table, position)).pop();
    let outputs = outputs.expect("outputs");
    assert_eq!(outputs.len(), DENSITY_OUTPUTS);
    visit(old, outputs[0], plan.step_min() * plan.density_scale(), plan.config.occupancy.decay)
}

#[test]
fn values_and_bits_agree_with_the_reference() {
    let mut random = Random::new(60);
    for (cascades, limit) in [(1, 0.01), (3, 1e6)] {
        let mut setup = Setup::tiny();
        setup.needs.cascades = cascades;
        setup.config.batch.samples = 1000;
        setup.config.occupancy.threshold = limit;
        setup.config.occupancy.decay = 0.9;
        let bench = Bench::new(&setup);
        bench.randomise(&mut random, 1.0, 2.0);
        let cells = bench.plan.cell_count();
        let first: Vec<f32> = (0..cells)
            .map(|cell| match cell % 5 {
                0 => UNSEEN as f32,
                1 => 0.0,
                _ => random.number(0.0, 0.1) as f32,
            })
            .collect();
        bench.write("occupancy", &first);
        let mut update = occupancy::Update::new(&bench.gpu, &bench.plan, &bench.workspace).expect("update");
        let mut want: Vec<f64> = first.iter().map(|&value| f64::from(value)).collect();
        let model = bench.model();
        let visible = visible_cells(&bench.plan);
        // Chunks of odd sizes and strides; the last one ends with the grid.
        for (first_cell, stride, count) in [(0, 1, 1), (7, 3, 130), (2, 3, 1000), (visible.len() - 65, 1, 65)]
        {
            bench.set_step(Step {
                first_cell: first_cell as u32,
                cell_stride: stride as u32,
                cell_count: count as u32,
                ..quiet_step()
            });
            bench.run(update.chunk(count));
            for cell in (0..count).map(|i| visible[first_cell + i * stride] as usize) {
                want[cell] = visited(&bench, cell, want[cell], &model);
            }
        }
        bench.run(update.bits());
        let got: Vec<f32> = bench.read("occupancy", cells);
        assert_close(&format!("occupancy, {cascades} cascades"), &got, &want, 1e-6, 2e-5);
        assert!(got.iter().step_by(5).all(|&value| value == -1.0), "cells that no camera sees changed");
        let mean: Vec<f32> = bench.read("occupancy_mean", 1);
        let seen = want.iter().filter(|&&value| value >= 0.0);
        let want_mean = seen.clone().sum::<f64>() / seen.count() as f64;
        assert_close("mean of the seen cells", &mean, &[want_mean], 0.0, 1e-5);
        let limit = threshold(&want, limit);
        assert_eq!(limit < want_mean, cascades == 1, "one case by the limit, one by the mean");
        let got_bits: Vec<u32> = bench.read("occupancy_bits", cells / 32);
        let want_bits = bits(&want, limit);
        let bit = |words: &[u32], cell: usize| (words[cell / 32] >> (cell % 32)) & 1;
        let mut set = 0;
        for cell in (0..cells).filter(|&cell| (want[cell] / limit - 1.0).abs() > 1e-4) {
            assert_eq!(bit(&got_bits, cell), bit(&want_bits, cell), "cell {cell}, value {}", want[cell]);
            set += bit(&got_bits, cell);
        }
        assert!(set > 0 && (set as usize) < cells, "{set} of {cells} cells are occupied");
    }
}

/// A grid of which no camera sees anything is empty, and its mean is a number.
#[test]
fn nothing_is_seen() {
    let bench = Bench::new(&Setup::tiny());
    let cells = bench.plan.cell_count();
    bench.write("occupancy", &vec![-1.0_f32; cells]);
    bench.write("occupancy_bits", &vec![u32::MAX; cells / 32]);
    let update = occupancy::Update::new(&bench.gpu, &bench.plan, &bench.workspace).expect("update");
    bench.run(update.bits());
    assert_eq!(bench.read::<f32>("occupancy_mean", 1), [0.0]);
    assert!(bench.read::<u32>("occupancy_bits", cells / 32).iter().all(|&word| word == 0));
}
