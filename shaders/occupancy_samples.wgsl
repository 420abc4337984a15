// One random position in each visited cell of a chunk, as samples for the density network.
// needs: cells, counters, dispatch, group, random, step

// Indices of the cells that can hold something.
var<storage, read> visible_cells: array<u32>;
tensor<write> samples: vec4<f32>;

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index == 0u {
        counters.samples = step.cell_count;
        dispatch_over_samples(step.cell_count);
    }
    if index >= step.cell_count {
        return;
    }
    let cell = visible_cells[step.first_cell + index * step.cell_stride];
    let offset = vec3(
        random_f32(step.stream, cell, RANDOM_CELL),
        random_f32(step.stream, cell, RANDOM_CELL + 1u),
        random_f32(step.stream, cell, RANDOM_CELL + 2u),
    );
    samples_store(index, vec4(cell_position(cell, offset), 0.0));
}
