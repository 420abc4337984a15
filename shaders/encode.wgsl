// Hash-grid features of each sample, two levels per thread: one pair of levels per row of workgroups, so that their
// entries stay in the cache.
// needs: counters, grid, group

tensor<read> samples: vec4<f32>;
tensor<read> table: vec2<f32>;
// `[samples, LEVELS / 2]`, the features of two levels in each.
tensor<write> encoding: vec4<f32>;

fn encode_level(position: vec3<f32>, level: Level) -> vec2<f32> {
    let cell = grid_cell(position, level);
    var feature = cell.weights[0] * table_load(cell.entries[0]);
    feature += cell.weights[1] * table_load(cell.entries[1]);
    feature += cell.weights[2] * table_load(cell.entries[2]);
    feature += cell.weights[3] * table_load(cell.entries[3]);
    feature += cell.weights[4] * table_load(cell.entries[4]);
    feature += cell.weights[5] * table_load(cell.entries[5]);
    feature += cell.weights[6] * table_load(cell.entries[6]);
    feature += cell.weights[7] * table_load(cell.entries[7]);
    return feature;
}

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.samples {
        return;
    }
    let position = samples_load(index).xyz;
    // A software driver gives each of its threads a run of rows: coarse and fine pairs in both halves, so that they have the
    // same work.
    let half = LEVELS / 4u;
    let pair = 2u * (id.y % half) + id.y / half;
    let low = encode_level(position, levels[2u * pair]);
    let high = encode_level(position, levels[2u * pair + 1u]);
    encoding_store(index * (LEVELS / 2u) + pair, vec4(low, high));
}
