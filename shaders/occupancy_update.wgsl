// Decays the visited cells and raises them to what the network says; see `reference::occupancy`.
// Cells that no camera sees hold -1 and stay. Needs: step, exp, density.

tensor<read> density_out: vec4<f32>;
// Optical depth of one smallest step.
var<storage, read_write> occupancy: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= step.cell_count {
        return;
    }
    let cell = step.first_cell + index * step.cell_stride;
    let old = occupancy[cell];
    if old >= 0.0 {
        let tau = exp_accurate(density_log(density_out_load(index * DENSITY_QUADS).x)) * STEP_MIN * DENSITY_SCALE;
        occupancy[cell] = max(old * OCCUPANCY_DECAY, tau);
    }
}
