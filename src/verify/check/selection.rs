//! Which samples get colour: select, scan and pack.

use super::inputs::{Random, random_batch, uniform};
use super::{CheckResult, CheckedAdapter, KeptSample, Setup, Workbench};
use crate::field::{color, dimension};
use crate::gpu::pass::Stage;
use crate::verify::reference::activation::{MAX_LOG_DENSITY, log_density};
use crate::verify::reference::composite::optical_depth;
use crate::verify::reference::model::TrainingRay;
use crate::verify::reference::occupancy::{OccupancyShape, visit};
use crate::verify::reference::selection::{self, Luck, select};
use anyhow::Result;

/// The stages of [`color::stages`] up to the packed samples.
const STAGES: usize = 4;

/// The selection of a plan on a workbench.
#[derive(Debug)]
pub struct Selecting {
    /// The buffers.
    pub bench: Workbench,
    stages: Vec<Stage>,
}

/// Chosen samples and what they stand for in both estimates: of ordinary rays, of a fog in which most end, with a high
/// floor, and all; and the occupancy grid, which all marched samples raise.
///
/// # Errors
/// When the device was lost or refuses a kernel.
pub fn selected_samples(adapter: &CheckedAdapter) -> Result<CheckResult> {
    let mut result =
        CheckResult::new("selection", 3e-6, "a weight over the floor, and its sum along the ray, round");
    let mut random = Random::new(30);
    let ordinary = Selecting::new(adapter, setup())?;
    for (rays, samples) in [(3, 0), (1, 1), (2, 3), (9, 65), (33, 130), (200, 250)] {
        let rays = random_batch(&mut random, rays, samples);
        let raw = raw_densities(&mut random, samples);
        ordinary.compare(&mut result, &rays, &raw)?;
    }
    let mut dense = setup();
    dense.config.selection.weight_floor = 0.0;
    let dense = Selecting::new(adapter, dense)?;
    let rays = random_batch(&mut random, 60, 380);
    let kept = dense.compare(&mut result, &rays, &random.numbers(380, 2.0, 3.0))?;
    result.holds(kept < 380, || "no ray ends in a fog".into());
    for (floor, light_share) in [(1.0, 1.0), (0.05, 0.01), (0.0, 1.0)] {
        let mut setup = setup();
        setup.config.selection.light_share = light_share;
        setup.config.selection.weight_floor = floor;
        setup.config.selection.stop_transmittance = 0.0;
        let selecting = Selecting::new(adapter, setup)?;
        let rays = random_batch(&mut random, 33, 130);
        let raw: Vec<f32> = raw_densities(&mut random, 130).into_iter().map(|raw| raw.min(0.0)).collect();
        let first = selecting.first_occupancy();
        selecting.bench.write("occupancy", &first);
        let kept = selecting.compare(&mut result, &rays, &raw)?;
        selecting.compare_occupancy(&mut result, &first, (&rays, &raw))?;
        result.holds((kept == 130) == (floor == 0.0), || format!("{kept} kept with a floor of {floor}"));
    }
    Ok(result)
}

/// A selection like the default one, of numbers that f32 holds.
fn setup() -> Setup {
    let mut setup = Setup::tiny();
    setup.config.selection.weight_floor = f64::from(0.02_f32);
    setup.config.selection.light_share = 0.125;
    setup.config.selection.stop_transmittance = f64::from(1e-4_f32);
    setup
}

/// Light, heavy and clamped samples.
fn raw_densities(random: &mut Random, samples: usize) -> Vec<f32> {
    let raw = (0..samples).map(|i| match i % 5 {
        0 => random.number(-12.0, -5.0) as f32,
        4 if i % 20 == 19 => 40.0,
        _ => random.number(-3.0, 5.0) as f32,
    });
    raw.collect()
}

impl Selecting {
    /// A workbench with the kernels of the selection.
    ///
    /// # Errors
    /// When the adapter cannot hold it or refuses a kernel.
    pub fn new(adapter: &CheckedAdapter, setup: Setup) -> Result<Self> {
        let bench = adapter.workbench(setup)?;
        let mut stages =
            color::stages(&bench.gpu, &bench.plan, &bench.workspace, color::SelectionMode::Training)?;
        stages.truncate(STAGES);
        Ok(Self { bench, stages })
    }

    /// Selects among the samples of `rays` with raw log-densities `raw`.
    ///
    /// # Errors
    /// When there is no room for them, or the device was lost.
    pub fn run(&self, rays: &[TrainingRay], raw: &[f32]) -> Result<()> {
        self.bench.upload(rays)?;
        self.bench.set_raw_density(raw);
        self.bench.run(&self.stages)
    }

    /// Cells that hold something, nothing, and can hold nothing.
    fn first_occupancy(&self) -> Vec<f32> {
        (0..self.bench.plan.cell_count()).map(|cell| [0.0, 0.004, -1.0, 0.02][cell % 4]).collect()
    }

    /// Every marched sample of rays without an end raises its cell, whatever is kept.
    fn compare_occupancy(
        &self,
        result: &mut CheckResult,
        first: &[f32],
        (rays, raw): (&[TrainingRay], &[f32]),
    ) -> Result<()> {
        let plan = &self.bench.plan;
        let shape = OccupancyShape {
            cascades: plan.space.cascades() as u32,
            resolution: plan.config.occupancy.cells,
        };
        let mut want: Vec<f64> = first.iter().map(|&value| value.into()).collect();
        for (sample, &raw) in rays.iter().flat_map(|ray| &ray.samples).zip(raw) {
            let cell = &mut want[shape.cell(sample.position)];
            *cell = visit(*cell, raw.into(), plan.least_step());
        }
        let got: Vec<f32> = self.bench.read("occupancy", want.len())?;
        result.each("occupancy", &got, &want, |cell| want[cell].abs().max(1e-6));
        let raised = want.iter().zip(first).filter(|(now, then)| **now > f64::from(**then)).count();
        result.holds(raised > 20, || format!("{raised} cells were raised"));
        Ok(())
    }

    /// Compares with the reference; returns how many samples were kept.
    fn compare(&self, result: &mut CheckResult, rays: &[TrainingRay], raw: &[f32]) -> Result<usize> {
        self.run(rays, raw)?;
        let counters = self.bench.counters()?;
        let kept = counters.kept as usize;
        let all_used = counters.rays_used as usize == rays.len() && counters.kept_wanted == counters.kept;
        result.holds(all_used, || format!("{counters:?}"));
        let spans: Vec<[u32; 2]> = self.bench.read("kept_spans", rays.len())?;
        let all = self.bench.kept(kept)?;
        let (mut first, mut packed, mut close) = (0, 0, 0);
        for (number, (ray, span)) in rays.iter().zip(&spans).enumerate() {
            let [begin, count] = span.map(|x| x as usize);
            let is_packed = begin == packed && begin + count <= kept;
            result.holds(is_packed, || format!("ray {number} is not behind the one before"));
            if !is_packed {
                return Ok(kept);
            }
            packed += count;
            let raw = &raw[first..first + ray.samples.len()];
            let chosen = Chosen { number, ray, raw, first, kept: &all[begin..packed] };
            close += usize::from(!chosen.compare(result, self.reference(&chosen)));
            first += ray.samples.len();
        }
        result.holds(packed == kept, || format!("{packed} of {kept} belong to rays"));
        result.holds(close * 10 <= rays.len(), || format!("{close} of {} too close to call", rays.len()));
        Ok(kept)
    }

    /// What the reference keeps of a ray; `None` where rounding may decide.
    fn reference(&self, &Chosen { ray, raw, first, .. }: &Chosen<'_>) -> Option<Vec<selection::Kept>> {
        let config = &self.bench.plan.config.selection;
        let selection = selection::Selection {
            stop_transmittance: config.stop_transmittance,
            floor: config.weight_floor,
            light_share: config.light_share,
        };
        let s: Vec<f64> = raw.iter().map(|&raw| log_density(f64::from(raw))).collect();
        let delta: Vec<f64> = ray.samples.iter().map(|sample| sample.delta).collect();
        let luck = |index: usize, nudge: f64| {
            let of = |first_dimension: u32| {
                [0, 1].map(|estimate| uniform(first + index, first_dimension + estimate) + nudge)
            };
            Luck { member: of(dimension::SELECTION), light: of(dimension::LIGHT) }
        };
        let (want, _) = select(&selection, &s, &delta, |index| luck(index, 0.0));
        // A little more or less luck, or light, must not change the choice.
        let indices = |kept: &[selection::Kept]| -> Vec<_> {
            kept.iter().map(|kept| (kept.index, kept.gains.map(|gain| gain > 0.0))).collect()
        };
        for nudge in [-1e-4, 1e-4] {
            let stop_transmittance = selection.stop_transmittance * (1.0 + nudge);
            let floor = selection.floor * (1.0 + nudge);
            let other = selection::Selection { stop_transmittance, floor, ..selection };
            for nudge in [-1e-5, 1e-5] {
                let (nudged, _) = select(&other, &s, &delta, |index| luck(index, nudge));
                if indices(&nudged) != indices(&want) {
                    return None;
                }
            }
        }
        Some(want)
    }
}

/// A ray and the samples of it that the device chose.
struct Chosen<'a> {
    number: usize,
    ray: &'a TrainingRay,
    /// Raw log-densities of its samples.
    raw: &'a [f32],
    /// Its first sample.
    first: usize,
    kept: &'a [KeptSample],
}

impl Chosen<'_> {
    /// Compares with what the reference keeps; false where that is not sure.
    fn compare(&self, result: &mut CheckResult, want: Option<Vec<selection::Kept>>) -> bool {
        let Self { number, ray, raw, first, .. } = *self;
        let case = || format!("ray {number} of {} samples", ray.samples.len());
        for kept in self.kept {
            let raw = raw.get((kept.sample as usize).wrapping_sub(first));
            let s = raw.map(|raw| raw.min(MAX_LOG_DENSITY as f32));
            result
                .holds(kept.ray as usize == number && s == Some(kept.s), || format!("{}: {kept:?}", case()));
        }
        let Some(want) = want else { return false };
        let samples = self.kept.iter().map(|kept| kept.sample as usize);
        let same = samples.eq(want.iter().map(|kept| first + kept.index));
        result.holds(same, || format!("{}: other samples than {want:?}", case()));
        if same {
            let depths: Vec<f64> = (raw.iter().zip(&ray.samples))
                .map(|(&raw, sample)| optical_depth(log_density(f64::from(raw)), sample.delta))
                .collect();
            let mut behind = 0;
            for (got, want) in self.kept.iter().zip(&want) {
                let delta = ray.samples[want.index].delta;
                result.value(got.delta.into(), delta, delta, || format!("{}: step", case()));
                let size = |estimate: usize| 1.0 + want.gains[estimate];
                result.each(&format!("{}: gains", case()), &got.gains, &want.gains, size);
                let gap: f64 = depths[behind..want.index].iter().sum();
                let before: f64 = depths[..want.index].iter().sum();
                result.value(got.gap.into(), gap, 1.0 + before, || format!("{}: gap", case()));
                behind = want.index + 1;
            }
        }
        true
    }
}
