// The encoding's backward pass: adds each kept sample's gradient to the eight corners of its cells.
// needs: corners, counters, group, usable

tensor<read> samples: vec4<f32>;
tensor<read> kept_rows: vec2<u32>;
// Two levels in each.
tensor<read> d_encoding: vec4<f32>;

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.kept || !gradients_usable() {
        return;
    }
    let position = samples_load(kept_rows_load(index).x).xyz;
    for (var l = 0u; l < LEVELS; l++) {
        let level = levels[l];
        let both = d_encoding_load(index * (LEVELS / 2u) + l / 2u);
        let gradient = select(both.xy, both.zw, (l & 1u) == 1u);
        if gradient.x == 0.0 && gradient.y == 0.0 {
            continue;
        }
        gradient_scatter(position, level, gradient);
    }
}
