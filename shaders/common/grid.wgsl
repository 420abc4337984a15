// Provides: levels of the hash grid (Müller et al. 2022); see `reference::grid`.

struct Level {
    // Cells per axis.
    resolution: u32,
    // First entry in the table.
    first: u32,
    // Number of entries; a power of two when hashed.
    entries: u32,
    // 1 when every vertex has an entry of its own.
    dense: u32,
}

var<uniform> levels: array<Level, LEVELS>;

struct GridCell {
    corner: vec3<u32>,
    weight: vec3<f32>,
}

fn grid_cell(position: vec3<f32>, level: Level) -> GridCell {
    let scaled = clamp(position, vec3(0.0), vec3(1.0)) * f32(level.resolution);
    let corner = min(vec3<u32>(scaled), vec3(level.resolution - 1u));
    return GridCell(corner, scaled - vec3<f32>(corner));
}

fn grid_entry(vertex: vec3<u32>, level: Level) -> u32 {
    if level.dense == 1u {
        let side = level.resolution + 1u;
        return level.first + vertex.x + side * (vertex.y + side * vertex.z);
    }
    let hash = vertex.x ^ (vertex.y * 2654435761u) ^ (vertex.z * 805459861u);
    return level.first + (hash & (level.entries - 1u));
}

// Trilinear weight of corner 0..7 (bit 0: x, bit 1: y, bit 2: z).
fn grid_weight(cell: GridCell, corner: u32) -> f32 {
    let high = vec3<f32>(vec3(corner, corner >> 1u, corner >> 2u) & vec3(1u));
    let factor = mix(1.0 - cell.weight, cell.weight, high);
    return factor.x * factor.y * factor.z;
}

fn grid_corner(cell: GridCell, corner: u32) -> vec3<u32> {
    return cell.corner + (vec3(corner, corner >> 1u, corner >> 2u) & vec3(1u));
}
