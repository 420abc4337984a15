//! The field and one batch through it: encode, density network, colour network, compositing, loss, and back.
//!
//! ```text
//! position ── grid ──> density network ──> 16 outputs ─┬─ first: s = min(raw, 15)
//!                                                      └─ all, s unclamped ─┐
//! direction ── harmonics ───────────────────────────────────────────────────┴─> colour network ──> colour
//! ```

use glam::DVec3;

use super::ColorRange;
use super::activation::{color, color_backward, log_density, log_density_backward};
use super::composite::CompositeInput;
use super::grid::{GridLevel, grid_encode, grid_encode_backward};
use super::harmonics::harmonics;
use super::loss::{Loss, Places, composite_with};
use super::mlp::Mlp;
use crate::config::Transmittance;

/// The field's parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Levels of the grid.
    pub levels: Vec<GridLevel>,
    /// Features of the grid, `[entries, 2]`.
    pub table: Vec<f64>,
    /// `[levels · 2]` to raw log-density and features, usually 16 together.
    pub density: Mlp,
    /// Those and 16 harmonics to raw colour.
    pub color: Mlp,
}

/// What the field's outputs mean and how they are composited.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Objective {
    /// Convention of the transmittance.
    pub transmittance: Transmittance,
    /// Range of the colours.
    pub color_range: ColorRange,
    /// How errors count.
    pub loss: Loss,
}

/// A sample to train on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RaySample {
    /// Position in box space.
    pub position: DVec3,
    /// Step, in the unit of the density.
    pub delta: f64,
    /// How many times its own weight its colour has in both estimates; 0 in both where it is left out, see
    /// [`super::selection`].
    pub gains: [f64; 2],
    /// Distance along the ray, in sides of the inner cube, like the ray's depth.
    pub distance: f64,
}

/// A ray to train on.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingRay {
    /// Unit viewing direction.
    pub direction: DVec3,
    /// Samples, front to back.
    pub samples: Vec<RaySample>,
    /// Target colour (premultiplied, over the background) and opacity.
    pub target: [f64; 4],
    /// Colour behind the ray.
    pub background: [f64; 3],
    /// Distance along the ray where something is known to be; 0 where it is not.
    pub depth: f64,
}

/// ∂loss/∂parameters, in the parameters' shapes.
#[derive(Clone, Debug, PartialEq)]
pub struct Gradients {
    /// By the grid's table.
    pub table: Vec<f64>,
    /// By the weights of each layer of the density network.
    pub density: Vec<Vec<f64>>,
    /// By the weights of each layer of the colour network.
    pub color: Vec<Vec<f64>>,
}

/// Loss and gradients of a batch.
#[derive(Clone, Debug, PartialEq)]
pub struct BatchOutput {
    /// Sum of the rays' shares.
    pub loss: f64,
    /// `[rays, 4]`: composited colour and opacity.
    pub rendered: Vec<[f64; 4]>,
    /// `[rays, 4]`: squared errors of both, with their weights.
    pub loss_terms: Vec<[f64; 4]>,
    /// Gradients of the loss.
    pub gradients: Gradients,
}

/// The field at one position and direction, with what the way back needs.
struct FieldValues {
    density: Vec<Vec<f64>>,
    color: Vec<Vec<f64>>,
}

impl FieldValues {
    /// The first output of the density network.
    fn raw_log_density(&self) -> f64 {
        last(&self.density)[0]
    }

    /// The outputs of the colour network.
    fn raw_color(&self) -> [f64; 3] {
        let raw = last(&self.color);
        [raw[0], raw[1], raw[2]]
    }
}

impl Model {
    /// Log-density `s` and colour at a position in box space, seen along a unit direction.
    pub fn query(&self, range: ColorRange, position: DVec3, direction: DVec3) -> (f64, [f64; 3]) {
        let evaluation = self.evaluate(position, direction);
        let s = log_density(evaluation.raw_log_density());
        (s, evaluation.raw_color().map(|raw| color(range, raw)))
    }

    /// Loss of the `M` rays, those without samples included, and its gradients; see [`super::loss`].
    pub fn forward_backward(&self, objective: Objective, rays: &[TrainingRay]) -> BatchOutput {
        let mut batch = BatchOutput {
            loss: 0.0,
            rendered: Vec::new(),
            loss_terms: Vec::new(),
            gradients: Gradients {
                table: vec![0.0; self.table.len()],
                density: self.density.zero_gradients(),
                color: self.color.zero_gradients(),
            },
        };
        for ray in rays {
            let evaluations: Vec<FieldValues> =
                (ray.samples.iter()).map(|sample| self.evaluate(sample.position, ray.direction)).collect();
            let distances = collect(&ray.samples, |sample| sample.distance);
            let composited = composite_with(
                objective.loss,
                objective.transmittance,
                &CompositeInput {
                    s: &collect(&evaluations, |e| log_density(e.raw_log_density())),
                    delta: &collect(&ray.samples, |sample| sample.delta),
                    color: &collect(&evaluations, |e| {
                        e.raw_color().map(|raw| color(objective.color_range, raw))
                    }),
                    target: ray.target,
                    background: ray.background,
                    rays_in_batch: rays.len() as u32,
                },
                Places { distances: &distances, depth: ray.depth },
                &collect(&ray.samples, |sample| sample.gains),
            );
            batch.loss += composited.loss;
            batch.rendered.push(composited.rendered);
            batch.loss_terms.push(composited.loss_terms);
            for (i, (sample, evaluation)) in ray.samples.iter().zip(&evaluations).enumerate() {
                if sample.gains == [0.0; 2] {
                    continue;
                }
                let d_s = composited.d_s[i];
                let raw_color = evaluation.raw_color();
                let d_raw_color: [f64; 3] = std::array::from_fn(|x| {
                    color_backward(objective.color_range, raw_color[x], composited.d_color[i][x])
                });
                let d_raw = log_density_backward(evaluation.raw_log_density(), d_s);
                let gradients = &mut batch.gradients;
                self.backward(sample.position, evaluation, d_raw, d_raw_color, gradients);
            }
        }
        batch
    }

    fn evaluate(&self, position: DVec3, direction: DVec3) -> FieldValues {
        let encoded = grid_encode(&self.levels, &self.table, position);
        let density = self.density.forward(&encoded);
        let color_input = [last(&density), &harmonics(direction)].concat();
        let color = self.color.forward(&color_input);
        FieldValues { density, color }
    }

    /// Adds one sample's part of the gradients.
    fn backward(
        &self,
        position: DVec3,
        evaluation: &FieldValues,
        d_raw_log_density: f64,
        d_raw_color: [f64; 3],
        gradients: &mut Gradients,
    ) {
        let d_color_input = (self.color).backward(&evaluation.color, &d_raw_color, &mut gradients.color);
        let mut d_density_output = d_color_input[..last(&evaluation.density).len()].to_vec();
        d_density_output[0] += d_raw_log_density;
        let d_encoded =
            (self.density).backward(&evaluation.density, &d_density_output, &mut gradients.density);
        grid_encode_backward(&self.levels, position, &d_encoded, &mut gradients.table);
    }
}

fn last(activations: &[Vec<f64>]) -> &[f64] {
    activations.last().map_or(&[], Vec::as_slice)
}

fn collect<T, U>(items: &[T], value: impl Fn(&T) -> U) -> Vec<U> {
    items.iter().map(value).collect()
}
