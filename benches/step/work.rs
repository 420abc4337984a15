//! How much a stage has to do at least: what its formulas multiply, and what it must read and write once, whatever caches
//! do. What a stage does beyond that (index arithmetic, weights read again) counts for nothing, but Adam counts as if every
//! entry of the table were touched. Caches can take a stage above the ceiling of memory; so can samples that lie together
//! and levels that are small above those of gathers and atomics from anywhere: what lies in one cell is added at once.

use nerf::config::Accumulation;
use nerf::field::Plan;
use nerf::field::layout::{COLOR_INPUTS, DENSITY_OUTPUTS, Layer};
use serde::Serialize;
use serde_json::Value;

/// Bytes of a vec4, of a span or a row, and of a table entry's two features.
const QUAD: f64 = 16.0;
const PAIR: f64 = 8.0;
/// Operations on a corner of a cell: two products for its weight, and a multiply-add for each of two features.
const FLOPS_OF_CORNER: f64 = 6.0;
const CORNERS: f64 = 8.0;

/// What a stage has to do in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(crate) struct Work {
    /// Multiplications and additions of f32.
    pub(crate) flops: f64,
    /// Bytes read and written in order.
    pub(crate) bytes: f64,
    /// Reads of 8 bytes or fewer from anywhere.
    pub(crate) gathers: f64,
    /// Atomic operations anywhere.
    pub(crate) atomics: f64,
    /// Whether those are of what the occupancy grid holds, not of the hash table.
    #[serde(skip)]
    of_occupancy: bool,
}

/// Rays and samples of a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Load {
    pub(crate) rays: f64,
    pub(crate) marched: f64,
    pub(crate) kept: f64,
}

impl Work {
    /// Of all stages called `label`; `None` where there is no such stage.
    pub(crate) fn of(plan: &Plan, label: &str, load: Load) -> Option<Self> {
        let Load { rays, marched, kept } = load;
        let layout = &plan.layout;
        let [encoding, outputs] = [layout.encoding() as f64, DENSITY_OUTPUTS as f64];
        let parameters = (4 * layout.quads) as f64;
        let bytes = |bytes: f64| Some(Self { bytes, ..Self::default() });
        match label {
            "rays" => bytes(rays * (4.0 * QUAD + 4.0 * plan.record().words() as f64)),
            // A bit of the occupancy grid per step, and a word of the marks per 32.
            "march" => Some(Self {
                bytes: rays * (2.0 * QUAD + PAIR) + marched / 8.0,
                gathers: marched,
                of_occupancy: true,
                ..Self::default()
            }),
            "scan samples" | "scan kept" => bytes(rays * 3.0 * PAIR),
            "samples" => bytes(rays * (2.0 * QUAD + PAIR) + marched * (QUAD + 1.0 / 8.0)),
            "encode" => Some(Self {
                flops: marched * encoding / 2.0 * CORNERS * FLOPS_OF_CORNER,
                bytes: marched * (QUAD + 4.0 * encoding),
                gathers: marched * encoding / 2.0 * CORNERS,
                ..Self::default()
            }),
            "density hidden" => Some(product(&layout.density[0], marched)),
            "density out" => Some(product(&layout.density[1], marched)),
            "opacities" => bytes(marched * 3.0 * QUAD),
            // Each sample raises its cell of the occupancy grid.
            "select" => Some(Self {
                bytes: rays * 20.0 + marched * QUAD + kept * QUAD,
                atomics: marched,
                of_occupancy: true,
                ..Self::default()
            }),
            "kept" => bytes(rays * 2.0 * PAIR + kept * (5.0 * QUAD + PAIR)),
            "color input" => bytes(kept * (PAIR + QUAD + 4.0 * (outputs + COLOR_INPUTS as f64))),
            "composite" => bytes(rays * 5.0 * QUAD + kept * 9.0 * QUAD),
            "d density out" => Some(backward(&layout.density[1], kept)),
            // Only the density network's outputs are wanted, with the gradient that the fused kernel found.
            "d color 0" => {
                let first = layout.color.first()?;
                let work = product(&Layer { inputs: DENSITY_OUTPUTS, ..*first }, kept);
                Some(Self { bytes: work.bytes + kept * (2.0 * QUAD + PAIR), ..work })
            }
            "d density hidden" => Some(product(&layout.density[0], kept)),
            "gradient range" => bytes(rays * QUAD + kept * 4.0 * encoding),
            "weight sums" => bytes((plan.chunks as f64 + 1.0) * 4.0 * parameters),
            "scatter" => Some(scatter(plan, kept)),
            // Parameter and both moments of two features, read and written, and their gradients.
            "adam table" => bytes(layout.entries as f64 * (2.0 * (PAIR + QUAD) + 2.0 * PAIR)),
            "adam mlp" => bytes(parameters * 4.0 * 7.0),
            "finish" => bytes(rays * QUAD),
            _ => of_layers(plan, label, kept),
        }
    }

    /// Seconds that it would take at the ceilings that `cargo bench --bench ceilings` measured, and what would take them.
    pub(crate) fn least_seconds(&self, plan: &Plan, ceilings: &Value) -> Option<(f64, &'static str)> {
        let table = match (plan.layout.entries * 8) >> 20 {
            _ if self.of_occupancy => "4 MiB",
            0..=4 => "4 MiB",
            5..=16 => "16 MiB",
            _ => "64 MiB",
        };
        let sums = match plan.accumulation {
            _ if self.of_occupancy => "integer",
            Accumulation::Float => "float",
            Accumulation::Fixed | Accumulation::Long => "integer",
            _ => "exchange",
        };
        let at =
            |amount: f64, rate: &Value| if amount > 0.0 { Some(amount / rate.as_f64()?) } else { Some(0.0) };
        let all = [
            (at(self.flops, &ceilings["flops_per_second"])?, "arithmetic"),
            (at(self.bytes, &ceilings["copied_bytes_per_second"])?, "memory"),
            (at(self.gathers, &ceilings["gathers_per_second"][table])?, "gathers"),
            (at(self.atomics, &ceilings["atomics_per_second"][sums])?, "atomics"),
        ];
        all.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))
    }
}

/// The layers of the colour network, forward and backward, and the gradients of weights.
fn of_layers(plan: &Plan, label: &str, kept: f64) -> Option<Work> {
    let (density, color) = (&plan.layout.density, &plan.layout.color);
    if let Some(number) = label.strip_prefix("color ") {
        return Some(product(color.get(number.parse::<usize>().ok()?)?, kept));
    }
    if let Some(number) = label.strip_prefix("d color ") {
        return Some(backward(color.get(number.parse::<usize>().ok()?)?, kept));
    }
    let outputs: usize = label.strip_prefix("d weights ")?.parse().ok()?;
    let layers = density.iter().chain(color).filter(|layer| layer.outputs == outputs);
    Some(layers.map(|layer| product(layer, kept)).fold(Work::default(), |sum, work| Work {
        flops: sum.flops + work.flops,
        bytes: sum.bytes + work.bytes,
        ..sum
    }))
}

/// A matrix product of `rows` rows: one matrix is read, one is written (or both are read for the weights' gradients).
fn product(layer: &Layer, rows: f64) -> Work {
    let [inputs, outputs] = [layer.inputs, layer.outputs].map(|size| size as f64);
    Work { flops: 2.0 * rows * inputs * outputs, bytes: 4.0 * rows * (inputs + outputs), ..Work::default() }
}

/// The same backward through a ReLU: what went in is read too.
fn backward(layer: &Layer, rows: f64) -> Work {
    let work = product(layer, rows);
    Work { bytes: work.bytes + 4.0 * rows * layer.inputs as f64, ..work }
}

fn scatter(plan: &Plan, kept: f64) -> Work {
    let encoding = plan.layout.encoding() as f64;
    let adds = kept * encoding * CORNERS;
    Work {
        flops: kept * encoding / 2.0 * CORNERS * FLOPS_OF_CORNER,
        bytes: kept * (QUAD + PAIR + 4.0 * encoding),
        atomics: match plan.accumulation {
            Accumulation::Ordered => 0.0,
            Accumulation::Fixed => 2.0 * adds,
            _ => adds,
        },
        ..Work::default()
    }
}
