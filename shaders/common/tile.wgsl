// Provides: what a tile of a weight gradient reads and writes.

struct Tile {
    // Quads per row of the inputs.
    input_quads: u32,
    // First quad of the layer in the weight buffer.
    first_quad: u32,
    // 1 when the inputs lie in the order of all marched samples.
    of_samples: u32,
    unused: u32,
}

var<uniform> tile: Tile;
tensor<read> layer_input: vec4<f32>;
tensor<read> d_output: vec4<f32>;
tensor<read> kept_rows: vec2<u32>;
// `[chunks, quads of all layers]`.
tensor<write> d_weight_chunks: vec4<f32>;

fn tile_row(row: u32) -> u32 {
    if tile.of_samples == 1u {
        return kept_rows_load(row).x;
    }
    return row;
}
