// Provides: depth_target, the distance of what the drawn pixel shows: along its ray, in sides of the inner cube, 0
// where unknown.
// needs: photos

fn depth_target(first_row: u32, drawn: u32, distance_per_depth: f32) -> f32 {
    return bitcast<f32>(photos_word(first_row, drawn * RECORD_WORDS + DEPTH_WORD)) * distance_per_depth;
}
