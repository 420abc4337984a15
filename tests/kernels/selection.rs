//! The selection where more samples are kept than fit.

use anyhow::Result;
use nerf::verify::check::Setup;
use nerf::verify::check::inputs::{Random, random_batch};
use nerf::verify::check::selection::Selecting;

use crate::bench::adapter;

/// The rays that do not fit are left out, from the first of them on.
#[test]
fn too_many_kept_samples() -> Result<()> {
    let mut setup = Setup::tiny();
    setup.config.march.most_steps = 32;
    setup.config.batch.kept = 60;
    let selecting = Selecting::new(&adapter()?, setup)?;
    let bench = &selecting.bench;
    let capacity = bench.plan.capacity.kept;
    let mut random = Random::new(32);
    for (rays, samples) in [(33, 130), (2, 130), (130, capacity), (150, 260)] {
        let batch = random_batch(&mut random, rays, samples);
        let mut used = 0;
        let mut fitting = 0;
        for ray in &batch {
            if fitting + ray.samples.len() > capacity {
                break;
            }
            fitting += ray.samples.len();
            used += 1;
        }
        selecting.run(&batch, &vec![0.0; samples])?;
        let counters = bench.counters()?;
        assert_eq!((counters.rays_used, counters.kept), (used, fitting as u32), "{rays} rays");
        assert_eq!(counters.kept_wanted as usize, samples);
        let spans: Vec<[u32; 2]> = bench.read("kept_spans", rays)?;
        assert!(spans.iter().all(|[first, count]| (first + count) as usize <= capacity));
        assert!(spans[used as usize..].iter().all(|span| *span == [0, 0]));
        let samples: Vec<u32> = bench.kept(fitting)?.iter().map(|kept| kept.sample).collect();
        assert_eq!(samples, (0..fitting as u32).collect::<Vec<_>>());
    }
    Ok(())
}
