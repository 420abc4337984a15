//! Which samples get colour: select, scan and pack.

use nerf::kernels::{color, marching};
use nerf::reference::activation::log_density;
use nerf::reference::model::TrainingRay;
use nerf::reference::selection::{Kept, Selection, select};

use crate::bench::{Bench, Random, Setup, dimension, random_batch, uniform};
use crate::close::assert_close;

/// A selection like the default one, of numbers that f32 holds.
fn setup() -> Setup {
    let mut setup = Setup::tiny();
    setup.config.selection.weight_floor = f64::from(1e-3_f32);
    setup.config.selection.keep_probability = f64::from(0.2_f32);
    setup.config.selection.stop_transmittance = f64::from(1e-4_f32);
    setup
}

/// A batch with its raw log-densities.
fn batch(random: &mut Random, rays: usize, samples: usize) -> (Vec<TrainingRay>, Vec<f32>) {
    let rays = random_batch(random, rays, samples);
    let raw = (0..samples).map(|i| match i % 5 {
        0 => random.number(-12.0, -5.0) as f32,
        4 if i % 20 == 19 => 40.0,
        _ => random.number(-3.0, 5.0) as f32,
    });
    (rays, raw.collect())
}

fn run(bench: &Bench, rays: &[TrainingRay], raw: &[f32]) {
    bench.upload(rays);
    bench.set_raw_density(raw);
    let (gpu, plan, workspace) = (&bench.gpu, &bench.plan, &bench.workspace);
    bench.run(&color::stages(gpu, plan, workspace, color::Selection::Training).expect("color"));
}

/// What the reference keeps of ray `number`; `None` where rounding may decide.
fn reference(bench: &Bench, number: usize, ray: &TrainingRay, raw: &[f32]) -> Option<Vec<Kept>> {
    let config = &bench.plan.config.selection;
    let selection = Selection {
        stop_transmittance: config.stop_transmittance,
        floor: config.weight_floor,
        probability: config.keep_probability,
    };
    let s: Vec<f64> = raw.iter().map(|&raw| log_density(f64::from(raw))).collect();
    let delta: Vec<f64> = ray.samples.iter().map(|sample| sample.delta).collect();
    let u = uniform(number, dimension::SELECTION);
    let want = select(&selection, &s, &delta, u);
    // A little more or less luck, or light, must not change the choice.
    let indices = |kept: &[Kept]| kept.iter().map(|kept| kept.index).collect::<Vec<_>>();
    for nudge in [-1e-4, 1e-4] {
        let stop_transmittance = selection.stop_transmittance * (1.0 + nudge);
        let other = Selection { stop_transmittance, floor: selection.floor * (1.0 + nudge), ..selection };
        for u in [u - 1e-5, u + 1e-5] {
            if indices(&select(&other, &s, &delta, u)) != indices(&want) {
                return None;
            }
        }
    }
    Some(want)
}

/// Runs the selection and compares it with the reference.
fn check(bench: &Bench, rays: &[TrainingRay], raw: &[f32]) {
    run(bench, rays, raw);
    let counters = bench.counters();
    let kept = counters.kept as usize;
    assert_eq!(counters.rays_used as usize, rays.len());
    assert_eq!(counters.kept_wanted, counters.kept);
    let spans: Vec<[u32; 2]> = bench.read("kept_spans", rays.len());
    let all = bench.kept(kept);
    let (mut first, mut packed, mut close) = (0, 0, 0);
    let (mut steps, mut want_steps) = (Vec::new(), Vec::new());
    for (number, (ray, span)) in rays.iter().zip(&spans).enumerate() {
        let [begin, count] = span.map(|x| x as usize);
        assert_eq!(begin, packed, "ray {number} is not packed behind the ray before it");
        packed += count;
        let raw = &raw[first..first + ray.samples.len()];
        let chosen = &all[begin..begin + count];
        for kept in chosen {
            assert_eq!(kept.ray as usize, number);
            assert_eq!(kept.s, raw[kept.sample as usize - first].min(15.0), "log-density of {kept:?}");
        }
        if let Some(want) = reference(bench, number, ray, raw) {
            let samples: Vec<usize> = chosen.iter().map(|kept| kept.sample as usize - first).collect();
            let want_samples: Vec<usize> = want.iter().map(|kept| kept.index).collect();
            assert_eq!(samples, want_samples, "ray {number} of {}", rays.len());
            steps.extend(chosen.iter().map(|kept| kept.delta));
            want_steps.extend(want.iter().map(|kept| kept.gain * ray.samples[kept.index].delta));
        } else {
            close += 1;
        }
        first += ray.samples.len();
    }
    assert_eq!(packed, kept);
    assert_close(&format!("kept steps, {} samples", raw.len()), &steps, &want_steps, 0.0, 1e-5);
    println!("selection: {kept} of {} kept, {close} of {} rays too close to call", raw.len(), rays.len());
    assert!(close * 10 <= rays.len());
}

#[test]
fn chosen_samples_agree_with_the_reference() {
    let bench = Bench::new(&setup());
    let mut random = Random::new(30);
    for (rays, samples) in [(3, 0), (1, 1), (2, 3), (9, 65), (33, 130), (200, 250)] {
        let (rays, raw) = batch(&mut random, rays, samples);
        check(&bench, &rays, &raw);
    }
}

/// A fog in which most rays end, every sample before that being kept.
#[test]
fn rays_end_where_they_are_opaque() {
    let mut setup = setup();
    setup.config.selection.keep_probability = 1.0;
    let bench = Bench::new(&setup);
    let mut random = Random::new(33);
    let rays = random_batch(&mut random, 60, 380);
    check(&bench, &rays, &random.numbers(380, 2.0, 3.0));
    assert!(bench.counters().kept < 380, "no ray ends");
}

/// The ends of the least probability: samples by their weight alone, and all of them.
#[test]
fn probability_at_its_ends() {
    for probability in [0.0, 1.0] {
        let mut setup = setup();
        setup.config.selection.keep_probability = probability;
        setup.config.selection.weight_floor = 1.0;
        setup.config.selection.stop_transmittance = 0.0;
        let bench = Bench::new(&setup);
        let mut random = Random::new(31);
        let (rays, mut raw) = batch(&mut random, 33, 130);
        raw.iter_mut().for_each(|raw| *raw = raw.min(0.0));
        check(&bench, &rays, &raw);
        assert_eq!(bench.counters().kept == 130, probability == 1.0);
    }
}

/// More kept samples than fit: the rays that do not fit are left out, from the first of them on.
#[test]
fn too_many_kept_samples() {
    let mut setup = Setup::tiny();
    setup.config.march.most_steps = 32;
    setup.config.batch.kept = 60;
    let bench = Bench::new(&setup);
    let capacity = marching::kept_capacity(&bench.plan);
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
        run(&bench, &batch, &vec![0.0; samples]);
        let counters = bench.counters();
        assert_eq!((counters.rays_used, counters.kept), (used, fitting as u32), "{rays} rays");
        assert_eq!(counters.kept_wanted as usize, samples);
        let spans: Vec<[u32; 2]> = bench.read("kept_spans", rays);
        assert!(spans.iter().all(|[first, count]| (first + count) as usize <= capacity));
        assert!(spans[used as usize..].iter().all(|span| *span == [0, 0]));
        let samples: Vec<u32> = bench.kept(fitting).iter().map(|kept| kept.sample).collect();
        assert_eq!(samples, (0..fitting as u32).collect::<Vec<_>>());
    }
}
