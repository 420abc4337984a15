// One random position in each visited cell of a chunk, as samples for the density network.
// needs: counters, dispatch, group, occupancy, random, step

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
    let within = cell % (CELLS * CELLS * CELLS);
    let cascade = cell / (CELLS * CELLS * CELLS);
    let corner = vec3(within % CELLS, (within / CELLS) % CELLS, within / (CELLS * CELLS));
    let offset = vec3(
        random_f32(step.stream, cell, RANDOM_CELL),
        random_f32(step.stream, cell, RANDOM_CELL + 1u),
        random_f32(step.stream, cell, RANDOM_CELL + 2u),
    );
    let position = ((vec3<f32>(corner) + offset) / f32(CELLS) - 0.5) * cascade_side(cascade) + 0.5;
    samples_store(index, vec4(position, 0.0));
}
