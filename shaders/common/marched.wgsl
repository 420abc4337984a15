// Provides: a marched sample as its ray's walk sees it, in a vec4.

struct Marched {
    // Its optical depth, and its opacity.
    tau: f32,
    alpha: f32,
    // Its cell of the occupancy grid, and what the network says there.
    occupancy: f32,
    cell: u32,
}

// Of numbers from 2 on, whose bits drivers leave as they are. There are fewer than 2^28 cells.
const CELL_BITS = 0x40000000u;

fn marched_pack(marched: Marched) -> vec4<f32> {
    return vec4(marched.tau, marched.alpha, marched.occupancy, bitcast<f32>(marched.cell | CELL_BITS));
}

fn marched_unpack(packed: vec4<f32>) -> Marched {
    return Marched(packed.x, packed.y, packed.z, bitcast<u32>(packed.w) & ~CELL_BITS);
}
