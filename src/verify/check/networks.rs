//! Both networks, forwards and backwards, and the scatter of their gradients into the hash table: everything that
//! a batch leaves behind.

use super::check_result::largest;
use super::grid::positions;
use super::inputs::{Random, random_batch};
use super::{CheckResult, CheckedAdapter, PassOutput, Setup, Workbench};
use crate::gpu::pass::Stage;
use crate::verify::reference::activation::color;
use crate::verify::reference::grid::grid_encode;
use crate::verify::reference::harmonics::harmonics;
use crate::verify::reference::model::TrainingRay;
use anyhow::Result;
use glam::DVec3;

/// The sizes of a field and its colours.
#[derive(Clone, Copy, Debug)]
pub struct FieldShape {
    /// Levels of the grid.
    pub levels: usize,
    /// Width of hidden layers.
    pub width: usize,
    /// Hidden layers of the colour network.
    pub color_layers: usize,
    /// Whether colours are linear light.
    pub hdr: bool,
    /// Whether last weights are so large that densities and colours reach their clamps, and sigmoids saturate.
    pub saturated: bool,
}

/// Shapes that use every part: those that are trained with by default, and a small one.
pub const SHAPES: [FieldShape; 4] = [
    FieldShape { levels: 8, width: 16, color_layers: 1, hdr: false, saturated: false },
    FieldShape { levels: 16, width: 64, color_layers: 2, hdr: false, saturated: false },
    FieldShape { levels: 8, width: 32, color_layers: 2, hdr: false, saturated: true },
    FieldShape { levels: 8, width: 32, color_layers: 2, hdr: true, saturated: true },
];

/// What a batch leaves, each with its own bound.
struct NetworkResults {
    density: CheckResult,
    color: CheckResult,
    rays: CheckResult,
    weights: CheckResult,
    table: CheckResult,
}

/// Batches of several sizes through fields of `shapes`, each value relative to the largest of its kind.
///
/// # Errors
/// When the device was lost or refuses a kernel.
pub fn networks(adapter: &CheckedAdapter, shapes: &[FieldShape]) -> Result<Vec<CheckResult>> {
    let values = "sums of up to 64 terms in 2 layers round; relative to the largest value";
    let gradients = "sums over up to 130 samples and 5 layers round; relative to the largest gradient";
    let mut results = NetworkResults {
        density: CheckResult::new("density network", 5e-6, values),
        color: CheckResult::new(
            "colour network",
            5e-6,
            "sums of up to 64 terms in 5 layers round; relative to the largest",
        ),
        rays: CheckResult::new(
            "rendered batch and its loss",
            1e-5,
            "as colours; squares double their errors",
        ),
        weights: CheckResult::new("gradients of both networks", 2e-5, gradients),
        table: CheckResult::new("hash grid: scattered gradients", 2e-5, gradients),
    };
    for shape in shapes {
        let bench = workbench(adapter, shape)?;
        let stages = bench.stages()?;
        for (case, batch) in batches(shape) {
            results.compare(&format!("{shape:?}, {case}"), &bench, &stages, &batch)?;
        }
        // What was taken out is gone: a batch without samples leaves no gradient.
        let empty = bench.train(&stages, &random_batch(&mut Random::new(0), 3, 0))?;
        results.table.holds(empty.d_table.iter().all(|&d| d == 0.0), || format!("{shape:?}, no samples"));
    }
    let NetworkResults { density, color, rays, weights, table } = results;
    Ok(vec![density, color, rays, weights, table])
}

fn workbench(adapter: &CheckedAdapter, shape: &FieldShape) -> Result<Workbench> {
    let mut setup = Setup::tiny().network(shape.width, shape.color_layers).hdr(shape.hdr);
    setup.config.grid.levels = shape.levels;
    let bench = adapter.workbench(setup)?;
    bench.randomise(&mut Random::new(20), 1.0, 1.0)?;
    if shape.saturated {
        let mut weights = bench.weights("mlp")?;
        weights[1][..shape.width].iter_mut().for_each(|weight| *weight *= 64.0);
        if let Some(last) = weights.last_mut() {
            last.iter_mut().for_each(|weight| *weight *= 12.0);
        }
        bench.set_weights("mlp", &weights)?;
    }
    Ok(bench)
}

/// Batches of odd sizes; one of special positions, and one of which all samples share a cell.
fn batches(shape: &FieldShape) -> Vec<(String, Vec<TrainingRay>)> {
    let mut random = Random::new(21);
    let sizes = [(3, 0), (1, 1), (2, 3), (9, 65), (33, 130)];
    let mut batches: Vec<_> = (sizes.into_iter())
        .map(|(rays, samples)| (format!("{samples} samples"), random_batch(&mut random, rays, samples)))
        .collect();
    let mut special = random_batch(&mut random, 33, 130);
    let everywhere = positions(&mut random, 130);
    for (sample, position) in special.iter_mut().flat_map(|ray| &mut ray.samples).zip(everywhere) {
        sample.position = position;
    }
    let mut crowd = random_batch(&mut random, 33, 130);
    for sample in crowd.iter_mut().flat_map(|ray| &mut ray.samples) {
        sample.position = (DVec3::splat(0.501) + random.vector(0.0, 0.02)).as_vec3().as_dvec3();
    }
    batches.extend([("at borders".into(), special), ("in one cell".into(), crowd)]);
    if shape.saturated {
        // Steps so short that a clamped density is not opaque, and has a gradient of either sign.
        let rays = batches.iter_mut().flat_map(|(_, batch)| batch.iter_mut().step_by(2));
        for sample in rays.flat_map(|ray| &mut ray.samples) {
            sample.delta = f64::from((sample.delta * 1e-6) as f32);
        }
    }
    batches
}

impl NetworkResults {
    /// Compares everything that a batch leaves with the reference.
    fn compare(
        &mut self,
        case: &str,
        bench: &Workbench,
        stages: &[Stage],
        rays: &[TrainingRay],
    ) -> Result<()> {
        let got = bench.train(stages, rays)?;
        let model = bench.model()?;
        let range = bench.objective().color_range;
        let (mut density, mut colors, mut most) = (Vec::new(), Vec::new(), 1.0_f64);
        for ray in rays {
            for sample in &ray.samples {
                let encoded = grid_encode(&model.levels, &model.table, sample.position);
                let outputs = model.density.forward(&encoded).pop().unwrap_or_default();
                let input = [outputs.as_slice(), &harmonics(ray.direction)].concat();
                let raw = model.color.forward(&input).pop().unwrap_or_default();
                most = most.max(largest(&raw));
                colors.extend(raw.iter().map(|&raw| color(range, raw)));
                density.extend(outputs);
            }
        }
        self.density.all(case, &got.density, &density);
        let want = model.forward_backward(bench.objective(), rays);
        // Exponentials turn the rounding error of a raw output, which grows with it, into a relative one.
        let each = |result: &mut CheckResult, case: &str, got: &[f32], want: &[f64]| {
            let scale = most * largest(want);
            result.each(case, got, want, |_| scale);
        };
        each(&mut self.color, case, &got.color, &colors);
        each(&mut self.rays, case, got.rendered.as_flattened(), want.rendered.as_flattened());
        self.rays.value(got.loss, want.loss, most * want.loss, || format!("loss, {case}"));
        each(&mut self.table, case, &got.d_table, &want.gradients.table);
        self.compare_weights(case, &got, want.gradients.density.iter().chain(&want.gradients.color), most);
        Ok(())
    }

    fn compare_weights<'a>(
        &mut self,
        case: &str,
        got: &PassOutput,
        want: impl Iterator<Item = &'a Vec<f64>>,
        most: f64,
    ) {
        for (number, (got, want)) in got.d_weights.iter().zip(want).enumerate() {
            let (used, unused) = got.split_at(want.len().min(got.len()));
            let scale = most * largest(want);
            self.weights.each(&format!("layer {number}, {case}"), used, want, |_| scale);
            self.weights.holds(unused.iter().all(|&d| d == 0.0), || format!("unused outputs, {case}"));
        }
    }
}
