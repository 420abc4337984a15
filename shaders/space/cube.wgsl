// Provides: a scene within one cube, which is box space, and equal steps along the ray; see `field::space` and
// `reference::march`.
// needs: cells, counters, ray

// The part of a ray that is modelled.
fn space_ray(origin: vec3<f32>, direction: vec3<f32>) -> Ray {
    return ray_through_box(origin, direction);
}

// Where the hash grid has a position: box space is its cube.
fn space_in_grid(position: vec3<f32>) -> vec3<f32> {
    return position;
}

// The cell of the occupancy grid around a position in the hash grid.
fn space_cell(in_grid: vec3<f32>) -> u32 {
    return cell_around(in_grid, 0u);
}

// Distance from a position to where a ray leaves its cell.
fn space_cell_exit(position: vec3<f32>, direction: vec3<f32>) -> f32 {
    return cell_exit(position, direction, 0u);
}

fn space_step_index(t: f32) -> f32 {
    return t / space_step_length(0.0);
}

// Length of the step that begins at u; not a difference of distances, which would cancel.
fn space_step_length(u: f32) -> f32 {
    return STEP_MIN * (1.0 + counters.step_excess);
}

fn space_step_distance(u: f32) -> f32 {
    return u * space_step_length(u);
}
