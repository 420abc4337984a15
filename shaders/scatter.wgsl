// The encoding's backward pass by atomics: adds each kept sample's gradient to the eight corners of its cells. A run of
// kept samples and a level belong to four threads: each adds one feature at the corners on one side of the cells along x,
// so that neighbouring threads add to neighbouring numbers at the same time. What lies in one cell is summed before it
// is added: the samples of a ray lie together, and share the cells of coarse levels.
// needs: counters, gradient_add, grid, group, usable

tensor<read> samples: vec4<f32>;
tensor<read> kept_rows: vec2<u32>;
// Two levels in each.
tensor<read> d_encoding: vec4<f32>;

fn corners_add(entries: vec4<u32>, feature: u32, gradients: vec4<f32>) {
    gradient_add(entries.x, feature, gradients.x);
    gradient_add(entries.y, feature, gradients.y);
    gradient_add(entries.z, feature, gradients.z);
    gradient_add(entries.w, feature, gradients.w);
}

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let feature = id.x & 1u;
    let is_far = (id.x & 2u) == 2u;
    let begin = (id.x / 4u) * SCATTER_RUN;
    if begin >= counters.kept || !gradients_usable() {
        return;
    }
    let end = min(begin + SCATTER_RUN, counters.kept);
    let level = levels[id.y];
    var entries = vec4(0u);
    var sums = vec4(0.0);
    for (var index = begin; index < end; index++) {
        let both = d_encoding_load(index * (LEVELS / 2u) + id.y / 2u);
        let own = select(both.xy, both.zw, (id.y & 1u) == 1u);
        let gradient = select(own.x, own.y, feature == 1u);
        let cell = grid_cell(samples_load(kept_rows_load(index).x).xyz, level);
        let near = vec4(cell.entries[0], cell.entries[2], cell.entries[4], cell.entries[6]);
        let far = vec4(cell.entries[1], cell.entries[3], cell.entries[5], cell.entries[7]);
        let near_weights = vec4(cell.weights[0], cell.weights[2], cell.weights[4], cell.weights[6]);
        let far_weights = vec4(cell.weights[1], cell.weights[3], cell.weights[5], cell.weights[7]);
        let corners = select(near, far, is_far);
        if any(corners != entries) {
            corners_add(entries, feature, sums);
            entries = corners;
            sums = vec4(0.0);
        }
        sums += select(near_weights, far_weights, is_far) * gradient;
    }
    corners_add(entries, feature, sums);
}
