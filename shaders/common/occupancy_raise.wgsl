// Provides: occupancy_raise, which raises a cell of the occupancy grid to what the network says in it, as the optical
// depth of one smallest step; see `reference::occupancy`.
// needs: exp

// Bits of floats: those of numbers from 0 on have the same order as the numbers, and cells that can hold nothing have -1,
// which is beyond all.
var<storage, read_write> occupancy: array<atomic<u32>>;

fn occupancy_depth(log_density: f32) -> f32 {
    return exp_accurate(log_density) * STEP_MIN * DENSITY_SCALE;
}

fn occupancy_raise(cell: u32, depth: f32) {
    atomicMax(&occupancy[cell], bitcast<u32>(depth));
}
