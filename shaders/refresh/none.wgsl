// Provides: occupancy_refresh, which leaves the occupancy grid as it is.

fn occupancy_refresh(position: vec3<f32>, log_density: f32) {
}
