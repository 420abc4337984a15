// Raises the visited cells to what the network says; see `reference::occupancy`. Cells that can hold nothing have -1
// and are not in the list.
// needs: density, group, occupancy_raise, step

var<storage, read> visible_cells: array<u32>;
tensor<read> density_out: vec4<f32>;

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= step.cell_count {
        return;
    }
    let cell = visible_cells[step.first_cell + index * step.cell_stride];
    occupancy_raise(cell, occupancy_depth(density_log(density_out_load(index * DENSITY_QUADS).x)));
}
