// Needs: exp, occupancy. Provides: occupancy_refresh, which raises the cell of a marched sample to what the network says
// there: where rays go, the occupancy grid costs no samples of its own.

// Bits of floats: those of numbers from 0 on have the same order as the numbers, and cells that can hold nothing have -1,
// which is beyond all.
var<storage, read_write> occupancy: array<atomic<u32>>;

fn occupancy_refresh(position: vec3<f32>, log_density: f32) {
    let cascade = cascade_at(position);
    let cell = vec3<u32>(clamp(cascade_position(position, cascade), vec3(0.0), vec3(f32(CELLS) - 1.0)));
    let tau = exp_accurate(log_density) * STEP_MIN * DENSITY_SCALE;
    atomicMax(&occupancy[cell_index(cell, cascade)], bitcast<u32>(tau));
}
