//! From rays to samples, through the occupancy grid.

use glam::DVec3;
use nerf::kernels::{marching, training};
use nerf::reference::march::{BoxRay, March, MarchSample, box_interval};
use nerf::reference::occupancy::{OccupancyShape, is_set};

use crate::bench::{Bench, Random, Setup, dimension, uniform};
use crate::close::assert_close;
use crate::rays::{drawn, pixel_camera};

/// How far, in box units, rounding may move a sample or a cell's border.
const BORDER: f64 = 1e-5;

/// Rays from outside and from inside, along the axes, through corners, and past the box.
fn rays(random: &mut Random) -> Vec<BoxRay> {
    let mut rays = Vec::new();
    for _ in 0..60 {
        let direction = random.direction();
        let target = random.vector(0.05, 0.95);
        let distance = random.number(0.3, 3.0);
        rays.push(BoxRay { origin: (target - distance * direction).as_vec3().as_dvec3(), direction });
        rays.push(BoxRay { origin: random.vector(0.1, 0.9), direction: random.direction() });
        rays.push(BoxRay { origin: random.vector(-3.0, 4.0), direction: random.direction() });
    }
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for direction in [axis, -axis] {
            rays.push(BoxRay { origin: DVec3::new(0.51, 0.37, 0.73) - 1.5 * direction, direction });
            rays.push(BoxRay { origin: DVec3::splat(0.45), direction });
            rays.push(BoxRay { origin: DVec3::splat(1.7), direction });
        }
    }
    rays
}

/// One camera of one pixel per ray, of which the kernel draws some.
fn bench(mut setup: Setup, rays: &[BoxRay]) -> Bench {
    setup.needs.cameras = rays.len();
    let mut bench = Bench::new(&setup);
    let cameras: Vec<_> = rays.iter().map(|ray| pixel_camera(ray.origin, ray.direction)).collect();
    bench.0.workspace.add(bench.0.gpu.storage_with("cameras", &cameras).expect("cameras"));
    bench.0.workspace.add(bench.0.gpu.storage::<u32>("pixels", 1).expect("pixels"));
    bench
}

fn run(bench: &Bench, count: usize, jitter: bool) {
    let (gpu, plan, workspace) = (&bench.gpu, &bench.plan, &bench.workspace);
    let mut stages = vec![training::rays(gpu, plan, workspace).expect("rays")];
    stages.extend(marching::stages(gpu, plan, workspace, jitter).expect("marching"));
    bench.set_rays(count);
    bench.run(&stages);
}

fn reference(bench: &Bench) -> March {
    let (config, cascades) = (&bench.plan.config, bench.plan.needs.cascades);
    March {
        shape: OccupancyShape { cascades, resolution: config.occupancy.cells },
        steps: config.march.steps,
        cone: config.march.cone,
        near: config.march.near / bench.plan.density_scale(),
        max_steps: config.march.most_steps as u32,
    }
}

fn random_bits(random: &mut Random, cells: usize, share: f64) -> Vec<u32> {
    let bit = |random: &mut Random| u32::from(random.number(0.0, 1.0) < share);
    (0..cells / 32).map(|_| (0..32).fold(0, |word, i| word | (bit(random) << i))).collect()
}

/// Whether rounding may decide if there is a sample at `t`: another cell's bit is within reach, or the end.
fn is_borderline(march: &March, words: &[u32], ray: BoxRay, t: f64, t_far: f64) -> bool {
    let here = is_set(words, march.shape.cell(ray.origin + t * ray.direction));
    let reach = |i: usize, bit: usize| if (i >> bit) & 1 == 1 { BORDER } else { -BORDER };
    let around = (0..8).any(|i| {
        let offset = DVec3::new(reach(i, 0), reach(i, 1), reach(i, 2));
        is_set(words, march.shape.cell(ray.origin + t * ray.direction + offset)) != here
    });
    around || (t - t_far).abs() < BORDER
}

fn check(bench: &Bench, rays: &[BoxRay], words: &[u32], count: usize, jitter: bool) -> (usize, usize) {
    bench.write("occupancy_bits", words);
    run(bench, count, jitter);
    let march = reference(bench);
    let counters = bench.counters();
    assert_eq!(counters.rays_used as usize, count);
    assert_eq!(counters.samples, counters.samples_wanted);
    let spans: Vec<[u32; 2]> = bench.read("ray_spans", count);
    let samples: Vec<[f32; 4]> = bench.read("samples", counters.samples as usize);
    let sizes = vec![(1, 1); rays.len()];
    let (mut packed, mut differing, mut agreeing) = (0, 0, 0);
    let (mut got_values, mut want_values) = (Vec::new(), Vec::new());
    let (mut got_steps, mut want_steps) = (Vec::new(), Vec::new());
    for (index, span) in spans.iter().enumerate() {
        let ray = rays[drawn(index, &sizes).0];
        let start = if jitter { uniform(index, dimension::OFFSET) } else { 0.5 };
        let want = march.samples(ray, start, words);
        let [first, number] = span.map(|x| x as usize);
        assert_eq!(first, packed, "ray {index} is not packed behind the ray before it");
        packed += number;
        let Some([t_near, t_far]) = box_interval(ray, march.near) else {
            assert!(number <= 1, "ray {index} misses the box");
            continue;
        };
        let got = &samples[first..first + number];
        let position =
            |sample: &[f32; 4]| DVec3::from_array([sample[0], sample[1], sample[2]].map(f64::from));
        let step_of = |sample: &[f32; 4]| {
            let t = (position(sample) - ray.origin).dot(ray.direction);
            let steps = march.u_from_t(t) - march.u_from_t(t_near) - start;
            assert!((steps - steps.round()).abs() < 0.02, "ray {index} has a sample between steps: {steps}");
            steps.round() as u32
        };
        let mut unmatched: Vec<&MarchSample> = want.iter().collect();
        let mut previous = None;
        for sample in got {
            let step = step_of(sample);
            assert!(previous.is_none_or(|previous| previous < step), "ray {index}: samples out of order");
            previous = Some(step);
            if let Some(found) = unmatched.iter().position(|want| want.step == step) {
                let want = unmatched.remove(found);
                got_values.extend(position(sample).to_array());
                want_values.extend(want.position.to_array());
                got_steps.push(sample[3]);
                want_steps.push(want.delta);
                agreeing += 1;
            } else {
                let t = march.step(t_near, start, step)[0];
                assert!(is_borderline(&march, words, ray, t, t_far), "ray {index}: a sample too many at {t}");
                differing += 1;
            }
        }
        for sample in unmatched {
            let close = is_borderline(&march, words, ray, sample.t, t_far);
            assert!(close, "ray {index}: the sample at {} is missing", sample.t);
            differing += 1;
        }
    }
    assert_eq!(packed, samples.len());
    let name = format!("{} cascades, {count} rays", march.shape.cascades);
    assert_close(&format!("samples, {name}"), &got_values, &want_values, 4e-6, 0.0);
    // A step is the difference of two distances of up to 4, each rounded.
    let rounding = 4.0 * 2.0 * f64::from(f32::EPSILON) / march.shape.side(0);
    let relative = if march.is_uniform() { 1e-6 } else { 1e-4 };
    assert_close(&format!("steps, {name}"), &got_steps, &want_steps, rounding, relative);
    (agreeing, differing)
}

#[test]
fn samples_agree_with_the_reference() {
    let mut random = Random::new(50);
    let rays = rays(&mut random);
    for cascades in [1, 3] {
        let mut setup = Setup::tiny();
        setup.needs.cascades = cascades;
        setup.config.batch.samples = 16384;
        let bench = bench(setup, &rays);
        let (mut agreeing, mut differing) = (0, 0);
        for (count, share, jitter) in
            [(1, 0.5, true), (3, 0.1, true), (65, 0.5, true), (130, 0.05, false), (250, 0.3, true)]
        {
            let words = random_bits(&mut random, bench.plan.cell_count(), share);
            let (same, different) = check(&bench, &rays, &words, count, jitter);
            agreeing += same;
            differing += different;
        }
        println!("{cascades} cascades: {agreeing} samples agree, {differing} at borders do not");
        assert!(agreeing > 1000 && differing * 200 < agreeing);
    }
}

/// Nothing occupied, everything occupied, and one occupied cell.
#[test]
fn full_and_empty_grids() {
    let mut random = Random::new(51);
    let rays = rays(&mut random);
    let mut setup = Setup::tiny();
    setup.config.batch.samples = 16384;
    let bench = bench(setup, &rays);
    let words = bench.plan.cell_count() / 32;
    assert_eq!(check(&bench, &rays, &vec![0; words], 65, true), (0, 0));
    let (agreeing, _) = check(&bench, &rays, &vec![u32::MAX; words], 65, true);
    assert!(agreeing > 500);
    let mut one = vec![0; words];
    let cell = reference(&bench).shape.cell(DVec3::splat(0.45));
    one[cell / 32] = 1 << (cell % 32);
    let (agreeing, _) = check(&bench, &rays, &one, 250, true);
    assert!(agreeing > 0);
}

/// No ray at all: nothing is marched and nothing breaks.
#[test]
fn no_rays() {
    let mut random = Random::new(52);
    let rays = rays(&mut random);
    let bench = bench(Setup::tiny(), &rays);
    bench.write("occupancy_bits", &vec![u32::MAX; bench.plan.cell_count() / 32]);
    run(&bench, 0, true);
    let counters = bench.counters();
    assert_eq!((counters.rays_used, counters.samples, counters.samples_wanted), (0, 0, 0));
}

/// More samples than fit: the leading rays that fit are used, nothing is written out of range.
#[test]
fn too_many_samples() {
    let mut random = Random::new(53);
    let rays = rays(&mut random);
    let mut small = Setup::tiny();
    let count = 250;
    small.config.batch.samples = 512;
    let mut large = small.clone();
    large.config.batch.samples = 16384;
    let [small, large] = [small, large].map(|setup| {
        let bench = bench(setup, &rays);
        bench.write("occupancy_bits", &vec![u32::MAX; bench.plan.cell_count() / 32]);
        bench
    });
    run(&large, count, true);
    let all = large.counters();
    let spans: Vec<[u32; 2]> = large.read("ray_spans", count);
    let used = spans.iter().take_while(|[first, number]| first + number <= 512).count();
    assert!(used < count && all.samples > 512);
    let spare: Vec<[f32; 4]> = vec![[-7.0; 4]; 512 + marching::SPARE_ROWS];
    small.write("samples", &spare);
    run(&small, count, true);
    let cut = small.counters();
    let [first, number] = spans[used - 1];
    assert_eq!(cut.rays_used as usize, used);
    assert_eq!((cut.samples, cut.samples_wanted), (first + number, all.samples));
    let samples = cut.samples as usize;
    assert_eq!(small.read::<[f32; 4]>("samples", samples), large.read::<[f32; 4]>("samples", samples));
    let behind = small.read::<[f32; 4]>("samples", 512 + marching::SPARE_ROWS);
    assert!(behind[samples..].iter().all(|sample| *sample == [-7.0; 4]));
    let spans: Vec<[u32; 2]> = small.read("ray_spans", count);
    assert!(spans[used..].iter().all(|span| *span == [0, 0]));
}
