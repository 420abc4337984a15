// Provides: cells of the occupancy grid in nested cubes. Cube CASCADES - 1 covers the box, each lower one its inner half;
// the cells of one cube come behind those of the cube in it.

// Side of a cube in box units.
fn cube_side(cube: u32) -> f32 {
    return exp2(f32(cube) - f32(CASCADES - 1u));
}

// Position in cells of a cube.
fn cell_coordinates(position: vec3<f32>, cube: u32) -> vec3<f32> {
    return ((position - 0.5) / cube_side(cube) + 0.5) * f32(CELLS);
}

// The cell of a cube around a position, or the nearest one.
fn cell_around(position: vec3<f32>, cube: u32) -> u32 {
    let cell = vec3<u32>(clamp(cell_coordinates(position, cube), vec3(0.0), vec3(f32(CELLS) - 1.0)));
    return cell.x + CELLS * (cell.y + CELLS * (cell.z + CELLS * cube));
}

// Distance from `position` to where a ray leaves its cell of a cube.
fn cell_exit(position: vec3<f32>, direction: vec3<f32>, cube: u32) -> f32 {
    let at = cell_coordinates(position, cube);
    let wall = floor(at) + select(vec3(0.0), vec3(1.0), direction > vec3(0.0));
    let speed = select(direction, vec3(1e-12), abs(direction) < vec3(1e-12));
    let steps = abs((wall - at) / speed);
    return min(steps.x, min(steps.y, steps.z)) * cube_side(cube) / f32(CELLS);
}

// The position at `offset`, within [0, 1), of a cell.
fn cell_position(cell: u32, offset: vec3<f32>) -> vec3<f32> {
    let within = cell % (CELLS * CELLS * CELLS);
    let cube = cell / (CELLS * CELLS * CELLS);
    let corner = vec3(within % CELLS, (within / CELLS) % CELLS, within / (CELLS * CELLS));
    return ((vec3<f32>(corner) + offset) / f32(CELLS) - 0.5) * cube_side(cube) + 0.5;
}
