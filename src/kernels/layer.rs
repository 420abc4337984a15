//! The matrix products of the networks, the one part of the kernels that is generated: software drivers are
//! several times faster when a layer's inputs stay in registers, which takes one line per multiplication.
//! Where the inputs come from and the outputs go is WGSL in `shaders/layer`.
//!
//! Every product handles several samples per thread, since reading a weight costs as much as several
//! multiplications. Rows behind the last are computed too; all buffers have room for them.

use std::fmt::Write;

/// Inputs and quads of outputs in one tile of a weight gradient.
pub const TILE_INPUTS: usize = 16;

/// Writes into a String, which cannot fail.
macro_rules! line {
    ($text:ident, $($format:tt)*) => {{
        let _ = writeln!($text, $($format)*);
    }};
}

/// `layer_store(row, o, Σ_k W[o][k] x[k])` for `samples` rows per thread. The weights are
/// `array<vec4<f32>, outputs / 4 * inputs>`, see [`crate::model::Layer`].
#[must_use]
pub fn forward(inputs: usize, outputs: usize, samples: usize) -> String {
    let mut text = head(inputs * outputs / 4, samples);
    for sample in 0..samples {
        for quad in 0..inputs / 4 {
            line!(text, "    let x{sample}_{quad} = layer_load(first + {sample}u, {quad}u);");
        }
    }
    line!(text, "    for (var o = 0u; o < {}u; o++) {{", outputs / 4);
    for sample in 0..samples {
        line!(text, "        var sum{sample} = vec4(0.0);");
    }
    for input in 0..inputs {
        line!(text, "        let w{input} = layer_weights[o * {inputs}u + {input}u];");
        for sample in 0..samples {
            let (quad, component) = (input / 4, COMPONENTS[input % 4]);
            line!(text, "        sum{sample} += w{input} * x{sample}_{quad}.{component};");
        }
    }
    for sample in 0..samples {
        line!(text, "        layer_store(first + {sample}u, o, sum{sample});");
    }
    text.push_str("    }\n}\n");
    text
}

/// `layer_d_store(row, k, Σ_o W[o][k] d[o])` for the first `wanted` inputs.
#[must_use]
pub fn backward(inputs: usize, wanted: usize, outputs: usize, samples: usize) -> String {
    let mut text = head(inputs * outputs / 4, samples);
    for sample in 0..samples {
        for quad in 0..outputs / 4 {
            line!(text, "    let d{sample}_{quad} = layer_gradient(first + {sample}u, {quad}u);");
        }
    }
    line!(text, "    for (var k = 0u; k < {}u; k++) {{", wanted / 4);
    for sample in 0..samples {
        line!(text, "        var sum{sample} = vec4(0.0);");
    }
    for quad in 0..outputs / 4 {
        for (component, name) in COMPONENTS.iter().enumerate() {
            let offset = quad * inputs + component;
            line!(text, "        let w{quad}_{component} = layer_weights[4u * k + {offset}u];");
            for sample in 0..samples {
                line!(text, "        sum{sample}.{name} += dot(w{quad}_{component}, d{sample}_{quad});");
            }
        }
    }
    for sample in 0..samples {
        line!(text, "        layer_d_store(first + {sample}u, k, sum{sample});");
    }
    text.push_str("    }\n}\n");
    text
}

/// One tile of `Σ_rows x[k] d[o]`: [`TILE_INPUTS`] inputs by `quads` quads of outputs, over one chunk of rows.
/// The sizes of the layer are in the uniform `tile`, so that one pipeline serves all layers.
#[must_use]
pub fn weight_gradient(quads: usize) -> String {
    let mut text = String::from(TILE_HEAD);
    for input in 0..TILE_INPUTS {
        for quad in 0..quads {
            line!(text, "    var sum{input}_{quad} = vec4(0.0);");
        }
    }
    text.push_str("    for (var row = begin; row < end; row++) {\n        let source = tile_row(row);\n");
    for quad in 0..TILE_INPUTS / 4 {
        line!(text, "        let x{quad} = layer_input[source * tile.input_quads + input + {quad}u];");
    }
    for quad in 0..quads {
        line!(text, "        let d{quad} = d_output[row * tile.output_quads + output + {quad}u];");
    }
    for input in 0..TILE_INPUTS {
        for quad in 0..quads {
            let component = COMPONENTS[input % 4];
            line!(text, "        sum{input}_{quad} += d{quad} * x{}.{component};", input / 4);
        }
    }
    text.push_str("    }\n");
    for quad in 0..quads {
        line!(text, "    let at{quad} = base + (output + {quad}u) * tile.input_quads * 4u + input * 4u;");
        for input in 0..TILE_INPUTS {
            line!(text, "    d_weight_chunks[at{quad} + {input}u] = sum{input}_{quad};");
        }
    }
    text.push_str("}\n");
    text
}

const COMPONENTS: [&str; 4] = ["x", "y", "z", "w"];

fn head(weights: usize, samples: usize) -> String {
    format!(
        "var<uniform> layer_weights: array<vec4<f32>, {weights}>;\n\
         @compute @workgroup_size(64)\n\
         fn main(@builtin(global_invocation_id) id: vec3<u32>) {{\n    \
             let first = id.x * {samples}u;\n    \
             if first >= layer_count() {{\n        return;\n    }}\n"
    )
}

const TILE_HEAD: &str = "\
@compute @workgroup_size(8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let chunk = id.x % CHUNKS;
    let number = id.x / CHUNKS;
    if number >= tile.input_tiles * tile.output_tiles {
        return;
    }
    let input = (number % tile.input_tiles) * TILE_INPUT_QUADS;
    let output = (number / tile.input_tiles) * TILE_OUTPUT_QUADS;
    let share = (layer_count() + CHUNKS - 1u) / CHUNKS;
    let begin = min(chunk * share, layer_count());
    let end = min(begin + share, layer_count());
    let base = chunk * MLP_QUADS + tile.first_quad;
";
