// The encoding's backward pass without atomics: each thread owns one level and adds the kept samples' gradients in
// their order, so that nothing collides and every sum is the same in every run. For adapters with few threads, where it
// is three times as fast as atomics.
// needs: counters, grid, usable

tensor<read> samples: vec4<f32>;
tensor<read> kept_rows: vec2<u32>;
// Two levels in each.
tensor<read> d_encoding: vec4<f32>;
tensor<read_write> d_table: vec2<f32>;

fn gradient_add(entry: u32, gradient: vec2<f32>) {
    d_table_store(entry, d_table_load(entry) + gradient);
}

@compute @workgroup_size(LEVELS / 2u)
fn main(@builtin(local_invocation_id) lane: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>) {
    // Coarse and fine levels in turn, so that the groups have the same work.
    let l = 2u * lane.x + group.x;
    let level = levels[l];
    let odd = (l & 1u) == 1u;
    let count = select(0u, counters.kept, gradients_usable());
    for (var index = 0u; index < count; index++) {
        let both = d_encoding_load(index * (LEVELS / 2u) + l / 2u);
        let gradient = select(both.xy, both.zw, odd);
        let cell = grid_cell(samples_load(kept_rows_load(index).x).xyz, level);
        gradient_add(cell.entries[0], cell.weights[0] * gradient);
        gradient_add(cell.entries[1], cell.weights[1] * gradient);
        gradient_add(cell.entries[2], cell.weights[2] * gradient);
        gradient_add(cell.entries[3], cell.weights[3] * gradient);
        gradient_add(cell.entries[4], cell.weights[4] * gradient);
        gradient_add(cell.entries[5], cell.weights[5] * gradient);
        gradient_add(cell.entries[6], cell.weights[6] * gradient);
        gradient_add(cell.entries[7], cell.weights[7] * gradient);
    }
}
