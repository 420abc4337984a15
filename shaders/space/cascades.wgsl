// Provides: a scene within nested cubes, each twice as wide as the one in it, and steps that grow with the distance,
// between STEP_MIN and STEP_MAX, all of them times the scale; see `field::space` and `reference::march`.
// needs: cells, counters, log, ray

const STEP_LINEAR_END = STEP_MIN / CONE;
const STEP_CONE_END = STEP_MAX / CONE;

// The part of a ray that is modelled.
fn space_ray(origin: vec3<f32>, direction: vec3<f32>) -> Ray {
    return ray_through_box(origin, direction);
}

// Where the hash grid has a position: box space is its cube.
fn space_in_grid(position: vec3<f32>) -> vec3<f32> {
    return position;
}

// The smallest cube around a position.
fn space_cube(position: vec3<f32>) -> u32 {
    let offset = abs(position - 0.5);
    let reach = max(offset.x, max(offset.y, offset.z));
    var cube = 0u;
    while cube < CASCADES - 1u && reach >= 0.5 * cube_side(cube) {
        cube++;
    }
    return cube;
}

// The cell of the occupancy grid around a position in the hash grid.
fn space_cell(in_grid: vec3<f32>) -> u32 {
    return cell_around(in_grid, space_cube(in_grid));
}

// Distance from a position to where a ray leaves its cell.
fn space_cell_exit(position: vec3<f32>, direction: vec3<f32>) -> f32 {
    return cell_exit(position, direction, space_cube(position));
}

fn space_step_scale() -> f32 {
    return 1.0 + counters.step_excess;
}

fn space_step_index(t: f32) -> f32 {
    let scale = space_step_scale();
    let middle = clamp(t, STEP_LINEAR_END, STEP_CONE_END);
    return min(t, STEP_LINEAR_END) / (scale * STEP_MIN)
        + log(middle / STEP_LINEAR_END) / log_one_plus(scale * CONE)
        + max(t - STEP_CONE_END, 0.0) / (scale * STEP_MAX);
}

fn space_step_distance(u: f32) -> f32 {
    let scale = space_step_scale();
    let growth = log_one_plus(scale * CONE);
    let linear = 1.0 / (scale * CONE);
    let cone = log(STEP_MAX / STEP_MIN) / growth;
    if u <= linear {
        return u * scale * STEP_MIN;
    }
    return STEP_LINEAR_END * exp(min(u - linear, cone) * growth) + max(u - linear - cone, 0.0) * scale * STEP_MAX;
}

// Length of the step that begins at u. Where a step lies within one of the three parts it is not a difference of
// distances, which would cancel.
fn space_step_length(u: f32) -> f32 {
    let scale = space_step_scale();
    let linear = 1.0 / (scale * CONE);
    if u + 1.0 <= linear {
        return scale * STEP_MIN;
    }
    let t = space_step_distance(u);
    if u >= linear && t * (1.0 + scale * CONE) <= STEP_CONE_END {
        return t * scale * CONE;
    }
    return space_step_distance(u + 1.0) - t;
}
