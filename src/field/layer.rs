//! The matrix products of the networks, the one part of the kernels that is generated: where sums stay in registers, each
//! multiplication takes a line. Where the inputs come from and the outputs go is WGSL in `shaders/layer_…` and
//! `shaders/common`.
//!
//! On CPUs a thread has whole rows of inputs in registers, several of them, since reading a weight costs as much as
//! several multiplications. On GPUs workgroups share tiles, see `tiled_layer.rs`. Rows behind the last are computed too;
//! all buffers have room for them.

use super::generated::{CHUNK, COMPONENTS, group_size, line};
use super::tiled_layer;
use std::fmt::Write;

/// How the networks are multiplied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Product {
    /// Each thread multiplies so many rows on its own.
    Rows(usize),
    /// Each thread multiplies four rows. Eight threads read eight weights together and pass them on, which software
    /// drivers with subgroups do several times faster than each reading all.
    SharedWeights,
    /// Workgroups read tiles of rows and weights together.
    Tiled,
}

/// Weights that threads read together.
const SHARED: usize = 8;

impl Product {
    /// Rows per thread.
    #[must_use]
    pub fn rows(self) -> usize {
        match self {
            Self::Rows(rows) => rows,
            Self::SharedWeights => 4,
            Self::Tiled => 1,
        }
    }

    /// `layer_store(row, o, Σ_k W[o][k] x[k])`. The weights are `array<vec4<f32>, outputs / 4 * inputs>`, see
    /// [`crate::field::layout::Layer`].
    #[must_use]
    pub fn forward(self, inputs: usize, outputs: usize) -> String {
        match self {
            Self::Tiled => tiled_layer::forward(inputs, outputs),
            _ => self.forward_rows(inputs, outputs),
        }
    }

    fn forward_rows(self, inputs: usize, outputs: usize) -> String {
        let mut text = self.head("layer_load, layer_store", inputs * outputs / 4);
        for row in 0..self.rows() {
            for quad in 0..inputs / 4 {
                line!(text, "    let x{row}_{quad} = layer_load(first + {row}u, {quad}u);");
            }
        }
        line!(text, "    for (var o = 0u; o < {}u; o++) {{", outputs / 4);
        self.zero_sums(&mut text);
        for input in 0..inputs {
            let start = input - input % SHARED;
            let together = format!("o * {inputs}u + {start}u + lane");
            self.weight(&mut text, input, &format!("o * {inputs}u + {input}u"), &together);
            for row in 0..self.rows() {
                let (quad, component) = (input / 4, COMPONENTS[input % 4]);
                line!(text, "        sum{row} += w{input} * x{row}_{quad}.{component};");
            }
        }
        for row in 0..self.rows() {
            line!(text, "        layer_store(first + {row}u, o, sum{row});");
        }
        text.push_str("    }\n}\n");
        text
    }

    /// `layer_d_store(row, k, Σ_o W[o][k] d[o])` for the first `wanted` inputs.
    #[must_use]
    pub fn backward(self, inputs: usize, wanted: usize, outputs: usize) -> String {
        match self {
            Self::Tiled => tiled_layer::backward(inputs, wanted, outputs),
            _ => self.backward_rows(inputs, wanted, outputs),
        }
    }

    fn backward_rows(self, inputs: usize, wanted: usize, outputs: usize) -> String {
        let mut text = self.head("layer_d_store, layer_gradient", inputs * outputs / 4);
        let quads = outputs / 4;
        for row in 0..self.rows() {
            for quad in 0..quads {
                line!(text, "    let d{row}_{quad} = layer_gradient(first + {row}u, {quad}u);");
            }
        }
        line!(text, "    for (var k = 0u; k < {}u; k++) {{", wanted / 4);
        self.zero_sums(&mut text);
        for number in 0..outputs {
            let (quad, component) = (number / 4, number % 4);
            let first = (quad - quad % 2) * inputs;
            // Two quads of outputs at once; the last one alone where their number is odd.
            let second = if quad - quad % 2 + 1 < quads { inputs } else { 0 };
            let together = format!("4u * k + {first}u + lane % 4u + (lane / 4u) * {second}u");
            let own = format!("4u * k + {}u", quad * inputs + component);
            self.weight(&mut text, number, &own, &together);
            for row in 0..self.rows() {
                let name = COMPONENTS[component];
                line!(text, "        sum{row}.{name} += dot(w{number}, d{row}_{quad});");
            }
        }
        for row in 0..self.rows() {
            line!(text, "        layer_d_store(first + {row}u, k, sum{row});");
        }
        text.push_str("    }\n}\n");
        text
    }

    /// Reads weight number `number`: from index `own`, or out of the eight read from index `together`.
    fn weight(self, text: &mut String, number: usize, own: &str, together: &str) {
        if self != Self::SharedWeights {
            line!(text, "        let w{number} = layer_weights[{own}];");
            return;
        }
        let (group, member) = (number / SHARED, number % SHARED);
        if member == 0 {
            line!(text, "        let shared{group} = layer_weights[{together}];");
        }
        line!(text, "        let w{number} = subgroupBroadcast(shared{group}, {member}u);");
    }

    fn zero_sums(self, text: &mut String) {
        for row in 0..self.rows() {
            line!(text, "        var sum{row} = vec4(0.0);");
        }
    }

    /// All threads of a workgroup go on or none: subgroups need all their members.
    fn head(self, needs: &str, weights: usize) -> String {
        let rows = self.rows();
        let (argument, lane) = if self == Self::SharedWeights {
            (", @builtin(subgroup_invocation_id) invocation: u32", "    let lane = invocation % 8u;\n")
        } else {
            ("", "")
        };
        format!(
            "// needs: group, layer_count, {needs}\n\
             var<uniform> layer_weights: array<vec4<f32>, {weights}>;\n\
             @compute @workgroup_size(GROUP_SIZE)\n\
             fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>{argument}) {{\n    \
                 let first = id.x * {rows}u;\n    \
                 if group.x * GROUP_SIZE * {rows}u >= layer_count() {{\n        return;\n    }}\n{lane}"
        )
    }
}

/// Inputs that one thread of a weight gradient covers.
const TILE_INPUTS: usize = 16;
/// Quads of outputs that it covers at most.
const TILE_OUTPUT_QUADS: usize = 4;
/// The same where threads share what they read.
const SHARED_INPUTS: usize = 4 * SHARED;

impl Product {
    /// `Σ_rows x[k] d[o]` over one chunk of rows, for a tile of a layer of `inputs` and `outputs`. Where tiles do not
    /// depend on the number of inputs, the text is the same for layers of as many outputs.
    #[must_use]
    pub fn weight_gradient(self, inputs: usize, outputs: usize) -> String {
        match self {
            Self::Rows(_) => own_weight_gradient(outputs / 4),
            Self::SharedWeights => shared_weight_gradient(outputs / 4),
            Self::Tiled => tiled_layer::weight_gradient(inputs, outputs),
        }
    }

    /// Threads of a weight gradient over `chunks` chunks of rows.
    #[must_use]
    pub fn weight_gradient_threads(self, inputs: usize, outputs: usize, chunks: usize) -> usize {
        let quads = outputs / 4;
        chunks
            * match self {
                Self::Rows(_) => (inputs / TILE_INPUTS) * (quads / quads.min(TILE_OUTPUT_QUADS)),
                Self::SharedWeights => inputs.div_ceil(SHARED_INPUTS) * SHARED,
                Self::Tiled => group_size(),
            }
    }
}

/// Each thread sums the gradients of four inputs: it reads their quad, and shares the outputs' gradients.
fn shared_weight_gradient(quads: usize) -> String {
    let mut text = String::from(SHARED_TILE_HEAD) + CHUNK;
    sums(&mut text, 4, quads);
    text.push_str("    for (var row = begin; row < end; row++) {\n");
    line!(text, "        let x = layer_input_load(tile_row(row) * tile.input_quads + input);");
    for quad in 0..quads {
        if quad % SHARED == 0 {
            let most = (quads - 1 - quad).min(SHARED - 1);
            let at = format!("row * {quads}u + {quad}u + min(lane, {most}u)");
            line!(text, "        let shared{} = d_output_load({at});", quad / SHARED);
        }
        line!(text, "        let d{quad} = subgroupBroadcast(shared{}, {}u);", quad / SHARED, quad % SHARED);
        for (input, component) in COMPONENTS.iter().enumerate() {
            line!(text, "        sum{input}_{quad} += d{quad} * x.{component};");
        }
    }
    text.push_str("    }\n    if first + lane >= tile.input_quads {\n        return;\n    }\n");
    store_sums(&mut text, 4, quads);
    text
}

/// Each thread sums a whole tile on its own.
fn own_weight_gradient(quads: usize) -> String {
    let tile = quads.min(TILE_OUTPUT_QUADS);
    let tiles = quads / tile;
    let mut text =
        TILE_HEAD.replace("OUTPUT_TILES", &format!("{tiles}u")).replace("OUTPUT_QUADS", &format!("{tile}u"));
    text.push_str(CHUNK);
    sums(&mut text, TILE_INPUTS, tile);
    text.push_str("    for (var row = begin; row < end; row++) {\n        let source = tile_row(row);\n");
    for quad in 0..TILE_INPUTS / 4 {
        line!(text, "        let x{quad} = layer_input_load(source * tile.input_quads + input + {quad}u);");
    }
    for quad in 0..tile {
        line!(text, "        let d{quad} = d_output_load(row * {quads}u + output + {quad}u);");
    }
    for input in 0..TILE_INPUTS {
        for quad in 0..tile {
            let component = COMPONENTS[input % 4];
            line!(text, "        sum{input}_{quad} += d{quad} * x{}.{component};", input / 4);
        }
    }
    text.push_str("    }\n");
    store_sums(&mut text, TILE_INPUTS, tile);
    text
}

fn sums(text: &mut String, inputs: usize, quads: usize) {
    for input in 0..inputs {
        for quad in 0..quads {
            line!(text, "    var sum{input}_{quad} = vec4(0.0);");
        }
    }
}

fn store_sums(text: &mut String, inputs: usize, quads: usize) {
    for quad in 0..quads {
        line!(text, "    let at{quad} = base + ((output + {quad}u) * tile.input_quads + input) * 4u;");
        for input in 0..inputs {
            line!(text, "    d_weight_chunks_store(at{quad} + {input}u, sum{input}_{quad});");
        }
    }
    text.push_str("}\n");
}

const TILE_HEAD: &str = "\
// needs: layer_count, tile
@compute @workgroup_size(8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let chunk = id.x % CHUNKS;
    let number = id.x / CHUNKS;
    let output = number % OUTPUT_TILES * OUTPUT_QUADS;
    let input = number / OUTPUT_TILES * 4u;
    if input >= tile.input_quads {
        return;
    }
";

const SHARED_TILE_HEAD: &str = "\
// needs: layer_count, tile
@compute @workgroup_size(8)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(subgroup_invocation_id) invocation: u32,
) {
    let lane = invocation % 8u;
    let chunk = group.x % CHUNKS;
    let output = 0u;
    let first = group.x / CHUNKS * 8u;
    let input = min(first + lane, tile.input_quads - 1u);
";
