//! From rays to samples, through the occupancy grid.

use super::inputs::{Random, uniform};
use super::rays::{drawn, pixel_camera};
use super::{CheckResult, CheckedAdapter, Setup, Workbench};
use crate::field::{Counters, dimension, march, rays};
use crate::gpu::pass::Stage;
use crate::verify::reference::march::{BoxRay, March, MarchSample, box_interval};
use crate::verify::reference::occupancy::{OccupancyShape, is_set};
use anyhow::Result;
use glam::DVec3;

/// How far, in box units, rounding may move a sample or a cell's border.
const BORDER: f64 = 1e-5;

/// A workbench with one camera of one pixel per ray, of which the kernel draws some.
#[derive(Debug)]
pub struct Marching {
    /// The buffers.
    pub bench: Workbench,
    /// The cameras' rays.
    pub rays: Vec<BoxRay>,
    /// By how much their steps are longer than the configuration's, as a share of them.
    pub step_excess: f32,
    /// With and without jitter.
    stages: [Vec<Stage>; 2],
}

/// What agrees and what does not.
struct Found {
    positions: CheckResult,
    steps: CheckResult,
    agreeing: usize,
    differing: usize,
}

/// Samples of random rays through random occupancy, in one cascade and in three, with steps as configured and longer ones,
/// empty and full grids among them.
///
/// # Errors
/// When the device was lost or refuses a kernel.
pub fn marched_samples(adapter: &CheckedAdapter) -> Result<Vec<CheckResult>> {
    let mut found = Found {
        positions: CheckResult::new(
            "marching: samples",
            4e-6,
            "distances of up to 4 box sides round, and logarithms of them",
        ),
        steps: CheckResult::new(
            "marching: steps",
            1e-5,
            "differences of two distances, where a step spans two parts of the cone",
        ),
        agreeing: 0,
        differing: 0,
    };
    for (cascades, step_excess) in [(1, 0.0), (3, 0.0), (1, 0.75), (3, 0.75), (3, 7.0)] {
        let mut setup = Setup::tiny().cascades(cascades);
        setup.config.batch.samples = 16384;
        let mut marching = Marching::new(adapter, setup)?;
        marching.step_excess = step_excess;
        let mut random = Random::new(50 + cascades);
        let cells = marching.bench.plan.cell_count();
        for (count, share, jitter) in [
            (1, 0.5, true),
            (3, 0.1, true),
            (65, 0.5, true),
            (130, 0.05, false),
            (250, 0.3, true),
            (65, 0.0, true),
            (65, 1.0, false),
        ] {
            let words = random_bits(&mut random, cells, share);
            marching.compare(&mut found, &words, count, jitter)?;
        }
        let mut one = vec![0; cells / 32];
        let cell = marching.reference().shape.cell(DVec3::splat(0.45));
        one[cell / 32] = 1 << (cell % 32);
        marching.compare(&mut found, &one, 250, true)?;
    }
    let Found { mut positions, steps, agreeing, differing } = found;
    let enough = agreeing > 2000 && differing * 200 < agreeing;
    positions.holds(enough, || format!("{agreeing} samples agree, {differing} at borders do not"));
    Ok(vec![positions, steps])
}

impl Marching {
    /// Allocates, with rays from outside and from inside, along the axes, through corners, and past the box.
    ///
    /// # Errors
    /// When the adapter cannot hold it or refuses a kernel.
    pub fn new(adapter: &CheckedAdapter, setup: Setup) -> Result<Self> {
        let rays = rays();
        let mut bench = adapter.workbench(setup)?;
        let cameras: Vec<_> = rays.iter().map(|ray| pixel_camera(ray.origin, ray.direction)).collect();
        bench.workspace.add(bench.gpu.storage_with("cameras", &cameras)?);
        bench.add_photos(&[])?;
        let stages = |jitter| -> Result<Vec<Stage>> {
            let mut stages = vec![rays::stage(&bench.gpu, &bench.plan, &bench.workspace, cameras.len())?];
            stages.extend(march::stages(&bench.gpu, &bench.plan, &bench.workspace, jitter)?);
            Ok(stages)
        };
        let stages = [stages(false)?, stages(true)?];
        Ok(Self { bench, rays, step_excess: 0.0, stages })
    }

    /// Draws and marches `count` rays.
    ///
    /// # Errors
    /// When the device was lost.
    pub fn run(&self, words: &[u32], count: usize, jitter: bool) -> Result<()> {
        self.bench.write("occupancy_bits", words);
        let (rays, step_excess) = (count as u32, self.step_excess);
        self.bench.set_counters(Counters { rays, step_excess, ..Counters::default() });
        self.bench.run(&self.stages[usize::from(jitter)])
    }

    /// The reference of this plan.
    fn reference(&self) -> March {
        March { scale: 1.0 + f64::from(self.step_excess), ..reference(&self.bench) }
    }

    fn compare(&self, found: &mut Found, words: &[u32], count: usize, jitter: bool) -> Result<()> {
        self.run(words, count, jitter)?;
        let march = self.reference();
        let case =
            format!("{} cascades, steps {} times as long, {count} rays", march.shape.cascades, march.scale);
        let counters = self.bench.counters()?;
        let spans: Vec<[u32; 2]> = self.bench.read("ray_spans", count)?;
        let samples: Vec<[f32; 4]> = self.bench.read("samples", counters.samples as usize)?;
        let pixels = vec![1; self.rays.len()];
        let mut packed = 0;
        for (index, span) in spans.iter().enumerate() {
            let [first, number] = span.map(|x| x as usize);
            let is_packed = first == packed && first + number <= samples.len();
            found.positions.holds(is_packed, || format!("{case}: ray {index} is not behind the one before"));
            if !is_packed {
                return Ok(());
            }
            packed += number;
            let start = if jitter { uniform(index, dimension::OFFSET) } else { 0.5 };
            let ray = MarchedRay { march, ray: self.rays[drawn(index, &pixels).0], start, words };
            ray.compare(found, &samples[first..packed], &format!("{case}, ray {index}"));
        }
        let all = packed == samples.len()
            && counters.rays_used as usize == count
            && counters.samples == counters.samples_wanted;
        found.positions.holds(all, || format!("{case}: {counters:?}"));
        Ok(())
    }
}

/// The reference of a workbench's plan.
pub(super) fn reference(bench: &Workbench) -> March {
    let (config, cascades) = (&bench.plan.config, bench.plan.space.cascades() as u32);
    March {
        shape: OccupancyShape { cascades, resolution: config.occupancy.cells },
        steps: config.march.steps,
        scale: 1.0,
        cone: config.march.cone,
        near: bench.plan.space.near(&config.march),
        max_steps: config.march.most_steps as u32,
    }
}

/// A ray with what the reference needs to march it.
struct MarchedRay<'a> {
    march: March,
    ray: BoxRay,
    start: f64,
    words: &'a [u32],
}

impl MarchedRay<'_> {
    /// Compares its samples: positions, and the length of the step.
    fn compare(&self, found: &mut Found, got: &[[f32; 4]], case: &str) {
        let Self { march, ray, start, words } = *self;
        let Some([t_near, t_far]) = box_interval(ray, march.near) else {
            found.positions.holds(got.len() <= 1, || format!("{case}: past the box"));
            return;
        };
        let want = march.samples(ray, start, words);
        let mut unmatched: Vec<&MarchSample> = want.iter().collect();
        let mut previous = None;
        for sample in got {
            let position = DVec3::new(sample[0].into(), sample[1].into(), sample[2].into());
            let t = (position - ray.origin).dot(ray.direction);
            let step = march.u_from_t(t) - march.u_from_t(t_near) - start;
            let is_step =
                (step - step.round()).abs() < 0.02 && previous.is_none_or(|before| before < step.round());
            found.positions.holds(is_step, || format!("{case}: a sample at step {step}"));
            previous = Some(step.round());
            match unmatched.iter().position(|want| f64::from(want.step) == step.round()) {
                Some(at) => {
                    self.compare_sample(found, position, sample[3].into(), unmatched.remove(at), case);
                }
                None => {
                    let [t, _] = march.step(t_near, start, step.round().max(0.0) as u32);
                    found
                        .positions
                        .holds(self.is_borderline(t, t_far), || format!("{case}: one too many at {t}"));
                    found.differing += 1;
                }
            }
        }
        for sample in unmatched {
            let is_borderline = self.is_borderline(sample.t, t_far);
            found.positions.holds(is_borderline, || format!("{case}: none at {}", sample.t));
            found.differing += 1;
        }
    }

    fn compare_sample(&self, found: &mut Found, position: DVec3, delta: f64, want: &MarchSample, case: &str) {
        for axis in 0..3 {
            found.positions.value(position[axis], want.position[axis], 1.0, || case.to_owned());
        }
        // Equal steps are a constant. Others may be the difference of two distances of up to 4, in units of the
        // inner cube.
        let rounding = if self.march.is_uniform() { 0.0 } else { 4.0 / self.march.shape.side(0) };
        let size = if self.march.is_uniform() { 100.0 * want.delta } else { want.delta + 1e-2 * rounding };
        found.steps.value(delta, want.delta, size, || case.to_owned());
        found.agreeing += 1;
    }

    /// Whether rounding may decide if there is a sample at `t`: another cell's bit is within reach, or the end.
    fn is_borderline(&self, t: f64, t_far: f64) -> bool {
        let Self { march, ray, words, .. } = *self;
        let bit = |offset: DVec3| is_set(words, march.shape.cell(ray.origin + t * ray.direction + offset));
        let reach = |i: usize, axis: usize| if (i >> axis) & 1 == 1 { BORDER } else { -BORDER };
        let around =
            (0..8).any(|i| bit(DVec3::new(reach(i, 0), reach(i, 1), reach(i, 2))) != bit(DVec3::ZERO));
        around || (t - t_far).abs() < BORDER
    }
}

fn rays() -> Vec<BoxRay> {
    let mut random = Random::new(49);
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
            let origin = (DVec3::new(0.51, 0.37, 0.73) - 1.5 * direction).as_vec3().as_dvec3();
            rays.push(BoxRay { origin, direction });
            rays.push(BoxRay { origin: DVec3::splat(0.45), direction });
            rays.push(BoxRay { origin: DVec3::splat(1.7), direction });
        }
    }
    rays
}

fn random_bits(random: &mut Random, cells: usize, share: f64) -> Vec<u32> {
    let bit = |random: &mut Random| u32::from(random.number(0.0, 1.0) < share);
    (0..cells / 32).map(|_| (0..32).fold(0, |word, i| word | (bit(random) << i))).collect()
}
