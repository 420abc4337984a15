//! The hash grid, apart from comparisons with the reference.

use anyhow::Result;
use glam::DVec3;
use nerf::config::Accumulation;
use nerf::field::density;
use nerf::verify::check::grid::encode;
use nerf::verify::check::inputs::{Random, random_batch};
use nerf::verify::check::{Forced, Setup};

use crate::bench::{adapter_with, workbench};

/// One sample in the middle of a cell of a dense level: the mean of eight entries.
#[test]
fn one_feature_by_hand() -> Result<()> {
    let bench = workbench(Setup::tiny())?;
    let level = bench.levels()[0];
    assert_eq!((level.resolution, level.offset, level.dense), (4, 0, true));
    let mut table = vec![0.0; bench.plan.layout.entries * 2];
    // Vertices (1, 2, 3) and (2, 3, 4), of 5³.
    table[2 * (1 + 5 * (2 + 5 * 3))] = 4.0;
    table[2 * (2 + 5 * (3 + 5 * 4))] = 12.0;
    bench.set_table(&table);
    let stages = density::stages(&bench.gpu, &bench.plan, &bench.workspace)?;
    let features = encode(&bench, &stages, &[DVec3::new(1.5, 2.5, 3.5) / 4.0])?;
    assert_eq!(features[0], 2.0);
    Ok(())
}

/// Sums of integers do not depend on the order in which threads add to them, and ordered ones have one.
#[test]
fn sums_are_the_same_every_time() -> Result<()> {
    let mut of_integers = Vec::new();
    for accumulation in [Accumulation::Fixed, Accumulation::Long, Accumulation::Ordered] {
        let adapter = match adapter_with(Forced { accumulation: Some(accumulation), ..Forced::default() }) {
            Err(error) if accumulation == Accumulation::Long => {
                println!("left out: {error:#}");
                continue;
            }
            adapter => adapter?,
        };
        let bench = adapter.workbench(Setup::tiny())?;
        let mut random = Random::new(13);
        bench.randomise(&mut random, 1.0, 1.0)?;
        let stages = bench.stages()?;
        // All collide in the same eight entries of every level.
        let mut batch = random_batch(&mut random, 33, 130);
        for sample in batch.iter_mut().flat_map(|ray| &mut ray.samples) {
            sample.position = DVec3::splat(0.501) + random.vector(0.0, 0.02);
        }
        let bits = |sums: Vec<f32>| sums.into_iter().map(f32::to_bits).collect::<Vec<_>>();
        let first = bits(bench.train(&stages, &batch)?.d_table);
        assert!(first.iter().any(|&bits| bits != 0));
        for _ in 0..3 {
            assert_eq!(bits(bench.train(&stages, &batch)?.d_table), first, "{accumulation:?}");
        }
        of_integers.extend(accumulation.is_of_integers().then_some(first));
    }
    assert!(
        of_integers.windows(2).all(|sums| sums[0] == sums[1]),
        "one atomic or two, the sums are the same"
    );
    Ok(())
}
