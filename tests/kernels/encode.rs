//! The hash grid's features and the scatter of their gradients.

use glam::DVec3;
use nerf::config::Accumulation;
use nerf::gpu::Gpu;
use nerf::kernels::density;
use nerf::model::DENSITY_OUTPUTS;
use nerf::reference::grid::grid_encode;
use nerf::reference::model::{RaySample, TrainingRay};

use crate::bench::{Bench, Random, Setup, open, random_batch};
use crate::close::{assert_close, largest};

/// A density network that hands 16 features through: each as the difference of its two rectified halves.
fn transparent(setup: Setup) -> Bench {
    let bench = Bench::new(&setup.network(32, 1));
    let mut weights = bench.weights("mlp");
    for feature in 0..DENSITY_OUTPUTS {
        for (half, sign) in [(0, 1.0), (1, -1.0)] {
            let hidden = 2 * feature + half;
            weights[0][hidden * 16 + feature] = sign;
            weights[1][feature * 32 + hidden] = sign;
        }
    }
    bench.set_weights("mlp", &weights);
    bench
}

/// Positions inside, on the borders of cells and of the box, and far outside.
fn positions(random: &mut Random, count: usize) -> Vec<DVec3> {
    let special = [0.0, 1.0, 0.25, 0.5, 1.0 - f64::from(f32::EPSILON) / 2.0, -0.25, 1.25, -1e30, 1e30, 1e-30];
    (0..count)
        .map(|i| match i % 4 {
            0 => random.vector(0.0, 1.0),
            1 => random.vector(-0.1, 1.1),
            2 => DVec3::splat(special[i / 4 % special.len()]),
            _ => {
                let [x, y, z] = [i, i / 3, i / 5].map(|i| special[i % special.len()]);
                DVec3::new(x, y, z)
            }
        })
        .collect()
}

fn one_ray(positions: &[DVec3]) -> TrainingRay {
    let sample = |&position| RaySample { position, delta: 0.1, gain: 1.0 };
    TrainingRay {
        direction: DVec3::Z,
        samples: positions.iter().map(sample).collect(),
        target: [0.0; 4],
        background: [0.0; 3],
    }
}

#[test]
fn features_agree_with_the_reference() {
    let mut random = Random::new(10);
    for finest in [40, 2048] {
        let bench = transparent(Setup { finest, ..Setup::tiny() });
        let levels = bench.levels();
        assert!(levels.iter().any(|level| level.dense) && levels.iter().any(|level| !level.dense));
        let table = random.numbers(bench.plan.layout.entries * 2, -1.0, 1.0);
        bench.set_table(&table);
        let table: Vec<f64> = table.iter().map(|&x| f64::from(x)).collect();
        let stages = density::stages(&bench.gpu, &bench.plan, &bench.workspace).expect("density");
        for count in [0, 1, 3, 65, 130] {
            let positions = positions(&mut random, count);
            bench.upload(&[one_ray(&positions)]);
            bench.run(&stages);
            let want: Vec<f64> = positions.iter().flat_map(|&p| grid_encode(&levels, &table, p)).collect();
            // A position times the resolution is rounded to f32: half a unit in the last place per axis.
            let rounding = 6.0 * f64::from(finest) * f64::from(f32::EPSILON) / 2.0;
            let name = format!("encode, {count} samples, finest {finest}");
            assert_close(&name, &bench.density(count), &want, rounding, 0.0);
        }
    }
}

/// One sample in the middle of a cell of every dense level: the mean of eight entries.
#[test]
fn one_feature_by_hand() {
    let bench = transparent(Setup::tiny());
    let level = bench.levels()[0];
    assert_eq!((level.resolution, level.offset, level.dense), (4, 0, true));
    let mut table = vec![0.0; bench.plan.layout.entries * 2];
    // Vertices (1, 2, 3) and (2, 3, 4), of 5³.
    table[2 * (1 + 5 * (2 + 5 * 3))] = 4.0;
    table[2 * (2 + 5 * (3 + 5 * 4))] = 12.0;
    bench.set_table(&table);
    bench.upload(&[one_ray(&[DVec3::new(1.5, 2.5, 3.5) / 4.0])]);
    bench.run(&density::stages(&bench.gpu, &bench.plan, &bench.workspace).expect("density"));
    assert_eq!(bench.density(1)[0], 2.0);
}

/// The variants that this adapter can run.
fn accumulations(gpu: &Gpu) -> Vec<Accumulation> {
    let mut variants = vec![Accumulation::Ordered, Accumulation::Exchange, Accumulation::Fixed];
    if gpu.has(wgpu::Features::SHADER_FLOAT32_ATOMIC) {
        variants.push(Accumulation::Float);
    }
    variants
}

#[test]
fn scattered_gradients_agree_with_the_reference() {
    for accumulation in accumulations(&open()) {
        let bench = transparent(Setup::tiny().accumulation(accumulation));
        assert_eq!(bench.plan.accumulation, accumulation);
        let mut random = Random::new(11);
        bench.set_table(&random.numbers(bench.plan.layout.entries * 2, -1.0, 1.0));
        let mut weights = bench.weights("mlp");
        for layer in &mut weights[2..] {
            *layer = random.numbers(layer.len(), -0.5, 0.5);
        }
        let last = weights.len() - 1;
        let inputs = weights[last].len() / 4;
        weights[last][3 * inputs..].fill(0.0);
        bench.set_weights("mlp", &weights);
        let stages = bench.stages();
        for (rays, samples) in [(1, 0), (1, 1), (2, 3), (9, 65), (33, 130)] {
            let mut batch = random_batch(&mut random, rays, samples);
            let special = positions(&mut random, samples);
            let all = batch.iter_mut().flat_map(|ray| &mut ray.samples);
            for (sample, position) in all.zip(special) {
                sample.position = position;
            }
            let got = bench.train(&stages, &batch);
            let want = bench.model().forward_backward(bench.objective(), &batch).gradients.table;
            let name = format!("scatter {accumulation:?}, {samples} samples");
            assert_close(&name, &got.d_table, &want, 2e-5 * largest(&want), 0.0);
            let touched = want.iter().filter(|&&d| d != 0.0).count();
            assert!((touched > 0) == (samples > 0), "{touched} entries touched by {samples} samples");
        }
    }
}

/// 130 samples of one cell: all collide in the same eight entries of every level.
fn crowd(random: &mut Random) -> Vec<TrainingRay> {
    let mut batch = random_batch(random, 33, 130);
    for sample in batch.iter_mut().flat_map(|ray| &mut ray.samples) {
        sample.position = DVec3::splat(0.501) + random.vector(0.0, 0.02);
    }
    batch
}

#[test]
fn collisions_sum_up() {
    for accumulation in accumulations(&open()) {
        let bench = Bench::new(&Setup::tiny().accumulation(accumulation));
        let mut random = Random::new(12);
        bench.randomise(&mut random, 1.0, 1.0);
        let stages = bench.stages();
        let batch = crowd(&mut random);
        let got = bench.train(&stages, &batch);
        let want = bench.model().forward_backward(bench.objective(), &batch).gradients.table;
        let name = format!("scatter {accumulation:?}, one cell");
        assert_close(&name, &got.d_table, &want, 2e-5 * largest(&want), 0.0);
        // What was taken out is gone: a batch without samples leaves no gradient.
        let empty = bench.train(&stages, &random_batch(&mut random, 3, 0));
        assert!(empty.d_table.iter().all(|&d| d == 0.0));
    }
}

/// Sums of integers do not depend on the order in which threads add to them, and ordered ones have one.
#[test]
fn sums_are_the_same_every_time() {
    let gpu = open();
    for accumulation in accumulations(&gpu) {
        if !matches!(accumulation, Accumulation::Fixed | Accumulation::Ordered) {
            continue;
        }
        let bench = Bench::new(&Setup::tiny().accumulation(accumulation));
        let mut random = Random::new(13);
        bench.randomise(&mut random, 1.0, 1.0);
        let stages = bench.stages();
        let batch = crowd(&mut random);
        let bits = |outcome: Vec<f32>| outcome.into_iter().map(f32::to_bits).collect::<Vec<_>>();
        let first = bits(bench.train(&stages, &batch).d_table);
        assert!(first.iter().any(|&bits| bits != 0));
        for _ in 0..3 {
            assert_eq!(bits(bench.train(&stages, &batch).d_table), first, "{accumulation:?}");
        }
    }
}
