// Provides: depth_target_store, which keeps nothing.

fn depth_target_store(ray: u32, first_row: u32, drawn: u32, distance_per_depth: f32) {
}
