//! The matrix products of the networks as GPUs like them. A workgroup reads a tile of rows and of weights together, each
//! value once and neighbours side by side, and multiplies out of its own memory. A thread holds a tile of sums in
//! registers: at a width of 64 sixteen multiplications of vec4 follow four reads.
//!
//! A workgroup has `GROUP_SIZE` threads and as many rows. Rows behind the last are computed too; all buffers have room.

use super::generated::{CHUNK, COMPONENTS, group_size, line};
use std::fmt::Write;

/// Bytes of workgroup memory that every adapter has.
const WORKGROUP_BYTES: usize = 16 << 10;
const QUAD_BYTES: usize = 16;
/// Most quads of a row that are read at once: 128 bytes, a line of the cache.
const MOST_BLOCK: usize = 8;
/// Most threads side by side over the quads of a row.
const MOST_COLUMNS: usize = 8;
/// Rows of a weight gradient that follow one another without a loop.
const UNROLLED: usize = 4;
/// Values that a thread fetches at once, at most.
const FETCHED: usize = 8;

/// `layer_store(row, o, Σ_k W[o][k] x[k])`.
pub(super) fn forward(inputs: usize, outputs: usize) -> String {
    let tiles = RowTiles::new(inputs / 4, outputs / 4);
    let (width, to) = (4 * tiles.block, tiles.to);
    let weights = Weights {
        count: width * to,
        source: format!("at / {width}u * {inputs}u + 4u * block + at % {width}u"),
        target: format!("at % {width}u * {to}u + at / {width}u"),
    };
    tiles.kernel(["layer_load", "layer_store"], &weights, |sum, row, weight, number| {
        format!("{sum} += {weight} * {row}.{};", COMPONENTS[number])
    })
}

/// `layer_d_store(row, k, Σ_o W[o][k] d[o])` for the first `wanted` inputs.
pub(super) fn backward(inputs: usize, wanted: usize, outputs: usize) -> String {
    let tiles = RowTiles::new(outputs / 4, wanted / 4);
    let weights = Weights {
        count: tiles.block * wanted,
        source: format!("(block + at / {wanted}u) * {inputs}u + at % {wanted}u"),
        target: format!("(at / {wanted}u * 4u + at % 4u) * {}u + at % {wanted}u / 4u", tiles.to),
    };
    tiles.kernel(["layer_gradient", "layer_d_store"], &weights, |sum, row, weight, number| {
        format!("{sum}.{} += dot({weight}, {row});", COMPONENTS[number])
    })
}

/// How a workgroup multiplies rows of `from` quads by weights to rows of `to` quads.
#[derive(Clone, Copy)]
struct RowTiles {
    from: usize,
    to: usize,
    /// Quads of a row that are read at once.
    block: usize,
    /// Threads side by side over the quads that are written, and rows per thread.
    columns: usize,
}

/// The weights of a block in the order in which threads read them: for each of four weights of a quad of the rows, those
/// of the quads that are written, side by side.
struct Weights {
    /// How many there are.
    count: usize,
    /// Where weight `at` of the block that begins at quad `block` lies in the layer.
    source: String,
    /// Where it goes.
    target: String,
}

impl RowTiles {
    fn new(from: usize, to: usize) -> Self {
        let fits = |block: usize| QUAD_BYTES * block * (group_size() + 4 * to) <= WORKGROUP_BYTES;
        let mut blocks = [MOST_BLOCK, 4, 2].into_iter();
        let block = blocks.find(|&block| from.is_multiple_of(block) && fits(block)).unwrap_or(1);
        Self { from, to, block, columns: columns(to) }
    }

    /// The kernel that reads rows with the first and writes them with the second of `names`; `term` adds to a sum what a
    /// row's quad makes of one of its four weights.
    fn kernel(
        self,
        [load, store]: [&str; 2],
        weights: &Weights,
        term: impl Fn(&str, &str, &str, usize) -> String,
    ) -> String {
        let Self { from, block, columns, .. } = self;
        let mut text = head(&format!("layer_count, {load}, {store}"));
        text.push_str("    let first = group.x * GROUP_SIZE;\n");
        text.push_str("    if first >= layer_count() {\n        return;\n    }\n");
        place(&mut text, columns);
        sums(&mut text, columns, self.across());
        line!(text, "    for (var block = 0u; block < {from}u; block += {block}u) {{");
        let row = format!("{load}(first + at / {block}u, block + at % {block}u)");
        fetch(&mut text, group_size() * block, "row_tile[at]", &row);
        let source = format!("layer_weights[{}]", weights.source);
        fetch(&mut text, weights.count, &format!("weight_tile[{}]", weights.target), &source);
        line!(text, "        workgroupBarrier();");
        line!(text, "        for (var quad = 0u; quad < {block}u; quad++) {{");
        self.multiply(&mut text, term);
        text.push_str("        }\n        workgroupBarrier();\n    }\n");
        for row in 0..columns {
            for quad in 0..self.across() {
                let at = format!("first + line + {}u, column + {}u", row * lines(columns), quad * columns);
                line!(text, "    {store}({at}, sum{row}_{quad});");
            }
        }
        text.push_str("}\n");
        line!(text, "var<storage, read> layer_weights: array<vec4<f32>>;");
        tile(&mut text, "row", group_size() * block);
        tile(&mut text, "weight", weights.count);
        text
    }

    /// Quads per thread of a row that is written.
    fn across(self) -> usize {
        self.to / self.columns
    }

    /// What one quad of each row adds to the sums.
    fn multiply(self, text: &mut String, term: impl Fn(&str, &str, &str, usize) -> String) {
        let Self { to, block, columns, .. } = self;
        for row in 0..columns {
            let at = format!("(line + {}u) * {block}u + quad", row * lines(columns));
            line!(text, "            let row{row} = row_tile[{at}];");
        }
        for number in 0..4 {
            for quad in 0..self.across() {
                let weight = format!("weight{number}_{quad}");
                let at = format!("(4u * quad + {number}u) * {to}u + column + {}u", quad * columns);
                line!(text, "            let {weight} = weight_tile[{at}];");
                for row in 0..columns {
                    let (sum, row) = (format!("sum{row}_{quad}"), format!("row{row}"));
                    line!(text, "            {}", term(&sum, &row, &weight, number));
                }
            }
        }
    }
}

/// `Σ_rows x[k] d[o]` over one chunk of rows per workgroup, for a layer of `inputs` and `outputs`.
pub(super) fn weight_gradient(inputs: usize, outputs: usize) -> String {
    let tiles = WeightTiles { from: inputs / 4, to: outputs / 4, columns: columns(outputs / 4) };
    let WeightTiles { from, to, columns } = tiles;
    let rows = rows_at_once(from + to);
    let mut text = head("layer_count, tile");
    text.push_str("    let chunk = group.x;\n");
    text.push_str(CHUNK);
    place(&mut text, columns);
    for part in 0..tiles.down() {
        line!(text, "    let input{part} = min(line + {}u, {}u);", part * lines(columns), from - 1);
    }
    sums(&mut text, 4 * tiles.down(), tiles.across());
    line!(text, "    for (var first = begin; first < end; first += {rows}u) {{");
    let row = |quads: usize| format!("first + at / {quads}u");
    let input = format!("layer_input_load(tile_row({}) * {from}u + at % {from}u)", row(from));
    let gradient = format!("d_output_load(({}) * {to}u + at % {to}u)", row(to));
    for (name, quads, load) in [("input", from, input), ("gradient", to, gradient)] {
        // Rows behind the chunk are another's; what the last one reads there lies within the buffer.
        let own = format!("select(vec4(0.0), {load}, {} < end)", row(quads));
        fetch(&mut text, rows * quads, &format!("{name}_tile[at]"), &own);
    }
    line!(
        text,
        "        workgroupBarrier();\n        for (var row = 0u; row < {rows}u; row += {UNROLLED}u) {{"
    );
    (0..UNROLLED).for_each(|row| tiles.multiply(&mut text, row));
    text.push_str("        }\n        workgroupBarrier();\n    }\n");
    tiles.store(&mut text);
    text.push_str("}\n");
    tile(&mut text, "input", rows * from);
    tile(&mut text, "gradient", rows * to);
    text
}

/// How a workgroup multiplies columns of `from` quads of inputs by `to` quads of gradients.
#[derive(Clone, Copy)]
struct WeightTiles {
    from: usize,
    to: usize,
    /// Threads side by side over the gradients.
    columns: usize,
}

impl WeightTiles {
    /// Quads of inputs per thread; the last one may be another thread's.
    fn down(self) -> usize {
        self.from.div_ceil(lines(self.columns))
    }

    /// Quads of gradients per thread.
    fn across(self) -> usize {
        self.to / self.columns
    }

    /// What row number `row` behind the loop's adds to the sums.
    fn multiply(self, text: &mut String, row: usize) {
        let Self { from, to, columns } = self;
        for quad in 0..self.across() {
            let at = format!("(row + {row}u) * {to}u + column + {}u", quad * columns);
            line!(text, "            let gradient{row}_{quad} = gradient_tile[{at}];");
        }
        for part in 0..self.down() {
            let input = format!("input{row}_{part}");
            line!(text, "            let {input} = input_tile[(row + {row}u) * {from}u + input{part}];");
            for (number, component) in COMPONENTS.iter().enumerate() {
                for quad in 0..self.across() {
                    let sum = format!("sum{}_{quad}", 4 * part + number);
                    line!(text, "            {sum} += gradient{row}_{quad} * {input}.{component};");
                }
            }
        }
    }

    fn store(self, text: &mut String) {
        let Self { from, columns, .. } = self;
        for part in 0..self.down() {
            line!(text, "    if line + {}u < {from}u {{", part * lines(columns));
            for quad in 0..self.across() {
                let output = format!("(column + {}u)", quad * columns);
                line!(text, "        let at{quad} = base + ({output} * {from}u + input{part}) * 4u;");
                for number in 0..4 {
                    let sum = format!("sum{}_{quad}", 4 * part + number);
                    line!(text, "        d_weight_chunks_store(at{quad} + {number}u, {sum});");
                }
            }
            text.push_str("    }\n");
        }
    }
}

/// The largest power of two up to [`MOST_COLUMNS`] that parts the quads of a row.
fn columns(quads: usize) -> usize {
    (1 << quads.trailing_zeros()).min(MOST_COLUMNS)
}

/// Threads one below the other.
fn lines(columns: usize) -> usize {
    group_size() / columns
}

/// Rows of so many quads that fit into workgroup memory, a multiple of [`UNROLLED`].
fn rows_at_once(quads: usize) -> usize {
    let most = WORKGROUP_BYTES / (QUAD_BYTES * quads);
    (1 << most.ilog2()).clamp(UNROLLED, group_size())
}

fn head(needs: &str) -> String {
    format!(
        "// needs: group, {needs}\n\
         @compute @workgroup_size(GROUP_SIZE)\n\
         fn main(@builtin(local_invocation_index) thread: u32, @builtin(workgroup_id) group: vec3<u32>) {{\n"
    )
}

/// Where in a tile a thread multiplies.
fn place(text: &mut String, columns: usize) {
    line!(text, "    let column = thread % {columns}u;\n    let line = thread / {columns}u;");
}

fn sums(text: &mut String, rows: usize, across: usize) {
    for row in 0..rows {
        for quad in 0..across {
            line!(text, "    var sum{row}_{quad} = vec4(0.0);");
        }
    }
}

/// All threads fetch `count` values, each several at once: a loop would wait for one before it asked for the next.
/// `source` and `target` are in terms of `at`.
fn fetch(text: &mut String, count: usize, target: &str, source: &str) {
    let group = group_size();
    for begin in (0..count).step_by(group * FETCHED) {
        text.push_str("        {\n");
        let numbers = (0..FETCHED).filter(|number| begin + number * group < count);
        for number in numbers.clone() {
            line!(text, "            let at{number} = thread + {}u;", begin + number * group);
            line!(text, "            let value{number} = {};", named(source, number));
        }
        for number in numbers {
            let store = format!("{} = value{number};", named(target, number));
            // Threads that have nothing left to fetch have read something all the same.
            match begin + (number + 1) * group <= count {
                true => line!(text, "            {store}"),
                false => line!(text, "            if at{number} < {count}u {{ {store} }}"),
            }
        }
        text.push_str("        }\n");
    }
}

/// `expression` with a number behind its variable `at`.
fn named(expression: &str, number: usize) -> String {
    let parts = expression.split_inclusive(|c: char| !c.is_alphanumeric() && c != '_');
    let name = |part: &str| match part.strip_prefix("at") {
        Some(rest) if !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_') => {
            format!("at{number}{rest}")
        }
        _ => part.to_owned(),
    };
    parts.map(name).collect()
}

fn tile(text: &mut String, name: &str, quads: usize) {
    line!(text, "var<workgroup> {name}_tile: array<vec4<f32>, {quads}>;");
}
