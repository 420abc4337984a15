// Provides: depth_target, which is not known.

fn depth_target(first_row: u32, drawn: u32, distance_per_depth: f32) -> f32 {
    return 0.0;
}
