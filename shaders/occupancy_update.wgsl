// Raises the visited cells to what the network says; see `reference::occupancy`. Cells that can hold nothing have -1
// and are not in the list. Needs: step, exp, density.

var<storage, read> visible_cells: array<u32>;
tensor<read> density_out: vec4<f32>;
// Optical depth of one smallest step.
var<storage, read_write> occupancy: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= step.cell_count {
        return;
    }
    let cell = visible_cells[step.first_cell + index * step.cell_stride];
    let tau = exp_accurate(density_log(density_out_load(index * DENSITY_QUADS).x)) * STEP_MIN * DENSITY_SCALE;
    occupancy[cell] = max(occupancy[cell], tau);
}
