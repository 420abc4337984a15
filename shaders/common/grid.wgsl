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

// The eight corners of a cell; corner c lies at the cell's far side along x, y, z where bit 0, 1, 2 of c is set.
struct GridCell {
    entries: array<u32, 8>,
    // Trilinear weights.
    weights: array<f32, 8>,
}

// What is common to several corners is computed once; everything has constant indices, so that software
// drivers keep it in registers.
fn grid_cell(position: vec3<f32>, level: Level) -> GridCell {
    let cells = i32(level.resolution);
    let scaled = clamp(position, vec3(0.0), vec3(1.0)) * f32(cells);
    // Signed, since vector units convert signed integers only.
    let signed_corner = min(vec3<i32>(scaled), vec3(cells - 1));
    let corner = vec3<u32>(signed_corner);
    let far = scaled - vec3<f32>(signed_corner);
    let near = 1.0 - far;
    let side = level.resolution + 1u;
    let dense = level.dense == 1u;
    let stride = select(vec2(2654435761u, 805459861u), vec2(side, side * side), dense);
    let x = vec2(corner.x, corner.x + 1u);
    let y = vec2(corner.y * stride.x, corner.y * stride.x + stride.x);
    let z = vec2(corner.z * stride.y, corner.z * stride.y + stride.y);
    let mask = level.entries - 1u;
    let yz = vec4(near.y * near.z, far.y * near.z, near.y * far.z, far.y * far.z);
    let hash_yz = vec4(y.x ^ z.x, y.y ^ z.x, y.x ^ z.y, y.y ^ z.y);
    let dense_yz = vec4(y.x + z.x, y.y + z.x, y.x + z.y, y.y + z.y);
    let even = level.first + select((vec4(x.x) ^ hash_yz) & vec4(mask), x.x + dense_yz, dense);
    let odd = level.first + select((vec4(x.y) ^ hash_yz) & vec4(mask), x.y + dense_yz, dense);
    let low = near.x * yz;
    let high = far.x * yz;
    return GridCell(
        array(even.x, odd.x, even.y, odd.y, even.z, odd.z, even.w, odd.w),
        array(low.x, high.x, low.y, high.y, low.z, high.z, low.w, high.w),
    );
}
