// Provides: cells of the occupancy grid. Cascade CASCADES - 1 covers the box, each lower one its inner half.

// Side of a cascade in box units.
fn cascade_side(cascade: u32) -> f32 {
    return exp2(f32(cascade) - f32(CASCADES - 1u));
}

// The smallest cascade around a box-space position.
fn cascade_at(position: vec3<f32>) -> u32 {
    if CASCADES == 1u {
        return 0u;
    }
    let offset = abs(position - 0.5);
    let reach = max(offset.x, max(offset.y, offset.z));
    var cascade = 0u;
    while cascade < CASCADES - 1u && reach >= 0.5 * cascade_side(cascade) {
        cascade++;
    }
    return cascade;
}

// Position in cells of a cascade.
fn cascade_position(position: vec3<f32>, cascade: u32) -> vec3<f32> {
    return ((position - 0.5) / cascade_side(cascade) + 0.5) * f32(CELLS);
}

// The cell of a cascade around a box-space position, or the nearest one.
fn cell_around(position: vec3<f32>, cascade: u32) -> u32 {
    let cell = vec3<u32>(clamp(cascade_position(position, cascade), vec3(0.0), vec3(f32(CELLS) - 1.0)));
    return cell.x + CELLS * (cell.y + CELLS * (cell.z + CELLS * cascade));
}
