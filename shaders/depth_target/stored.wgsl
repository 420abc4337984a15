// Needs: photos_word. Provides: depth_target_store, which keeps the depth of the drawn pixel.

// Distance along the ray in sides of the inner cube, 0 where unknown.
var<storage, read_write> depth_targets: array<f32>;

fn depth_target_store(ray: u32, first_row: u32, drawn: u32, distance_per_depth: f32) {
    let depth = bitcast<f32>(photos_word(first_row, drawn * RECORD_WORDS + DEPTH_WORD));
    depth_targets[ray] = depth * distance_per_depth;
}
