//! Marching where there is nothing, or more than fits.

use anyhow::Result;
use nerf::field::capacity::SPARE_ROWS;
use nerf::field::march::{Scanned, scan};
use nerf::verify::check::Setup;
use nerf::verify::check::marching::Marching;

use crate::bench::{adapter, workbench};

/// A full occupancy grid.
fn full(marching: &Marching) -> Vec<u32> {
    vec![u32::MAX; marching.bench.plan.cell_count() / 32]
}

/// No ray at all: nothing is marched and nothing breaks.
#[test]
fn no_rays() -> Result<()> {
    let marching = Marching::new(&adapter()?, Setup::tiny())?;
    marching.run(&full(&marching), 0, true)?;
    let counters = marching.bench.counters()?;
    assert_eq!((counters.rays_used, counters.samples, counters.samples_wanted), (0, 0, 0));
    Ok(())
}

/// Threads that share a ray mark the steps that one alone marks; only at the border of a cell one may begin where the other
/// leaps.
#[test]
fn threads_share_a_ray() -> Result<()> {
    for cascades in [1, 3] {
        let spans = |lanes| -> Result<Vec<[u32; 2]>> {
            let mut setup = Setup { march_lanes: Some(lanes), ..Setup::tiny().cascades(cascades) };
            setup.config.batch.samples = 16384;
            let marching = Marching::new(&adapter()?, setup)?;
            let cells = marching.bench.plan.cell_count();
            let words: Vec<u32> = (0..cells as u32 / 32).map(|word| word.wrapping_mul(0x9e37_79b9)).collect();
            marching.run(&words, 250, true)?;
            marching.bench.read("ray_spans", 250)
        };
        let alone = spans(1)?;
        assert!(alone.iter().any(|[_, count]| *count > 20));
        for lanes in [2, 4] {
            let together = spans(lanes)?;
            let counts =
                alone.iter().zip(&together).map(|([_, alone], [_, together])| alone.abs_diff(*together));
            assert!(counts.sum::<u32>() < 5, "{lanes} threads: {alone:?}, {together:?}");
        }
    }
    Ok(())
}

/// More samples than fit: the leading rays that fit are used, nothing is written out of range.
#[test]
fn too_many_samples() -> Result<()> {
    let marching = |samples| {
        let mut setup = Setup::tiny();
        setup.config.batch.samples = samples;
        Marching::new(&adapter()?, setup)
    };
    let (count, capacity) = (250, 512);
    let [small, large] = [marching(capacity)?, marching(16384)?];
    large.run(&full(&large), count, true)?;
    let all = large.bench.counters()?;
    let spans: Vec<[u32; 2]> = large.bench.read("ray_spans", count)?;
    let used = spans.iter().take_while(|[first, number]| (first + number) as usize <= capacity).count();
    assert!(used < count && all.samples as usize > capacity);
    small.bench.write("samples", &vec![[-7.0_f32; 4]; capacity + SPARE_ROWS]);
    small.run(&full(&small), count, true)?;
    let cut = small.bench.counters()?;
    let [first, number] = spans[used - 1];
    assert_eq!(cut.rays_used as usize, used);
    assert_eq!((cut.samples, cut.samples_wanted), (first + number, all.samples));
    let samples = cut.samples as usize;
    let kept: Vec<[f32; 4]> = small.bench.read("samples", capacity + SPARE_ROWS)?;
    assert_eq!(kept[..samples], large.bench.read::<[f32; 4]>("samples", samples)?);
    assert!(kept[samples..].iter().all(|sample| *sample == [-7.0; 4]));
    let spans: Vec<[u32; 2]> = small.bench.read("ray_spans", count)?;
    assert!(spans[used..].iter().all(|span| *span == [0, 0]));
    Ok(())
}

/// A scan over more rays than a workgroup takes at once, where all samples fit and where only some do.
#[test]
fn many_rays_are_scanned() -> Result<()> {
    let rays = 2500;
    let counts: Vec<u32> = (0..rays).map(|ray| ray * 7 % 13).collect();
    let wanted: u32 = counts.iter().sum();
    for capacity in [wanted, wanted - 1, wanted / 3, 512] {
        let mut setup = Setup::tiny();
        (setup.config.batch.samples, setup.config.batch.rays) = (capacity as usize, 4096);
        let bench = workbench(setup)?;
        bench.write("ray_spans", &counts.iter().map(|&count| [9, count]).collect::<Vec<_>>());
        bench.set_rays(counts.len());
        bench.run([&scan(&bench.gpu, &bench.plan, &bench.workspace, Scanned::Samples)?])?;
        let (mut first, mut spans, mut used, mut samples) = (0, Vec::new(), 0, 0);
        for &count in &counts {
            let fits = first + count <= capacity;
            spans.push(if fits { [first, count] } else { [0, 0] });
            first += count;
            (used, samples) = if fits { (used + 1, first) } else { (used, samples) };
        }
        let counters = bench.counters()?;
        let found = (counters.rays_used, counters.samples, counters.samples_wanted);
        assert_eq!(found, (used, samples, wanted), "room for {capacity}");
        assert_eq!(bench.read::<[u32; 2]>("ray_spans", counts.len())?, spans, "room for {capacity}");
    }
    Ok(())
}
