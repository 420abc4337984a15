// The encoding's backward pass without atomics: each thread owns one level and adds the kept samples' gradients in
// their order, so that nothing collides and every sum is the same in every run. For adapters with few threads, where it
// is three times as fast as atomics.
// needs: corners, counters, usable

tensor<read> samples: vec4<f32>;
tensor<read> kept_rows: vec2<u32>;
// Two levels in each.
tensor<read> d_encoding: vec4<f32>;

@compute @workgroup_size(8)
fn main(@builtin(local_invocation_id) lane: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>) {
    // Coarse and fine levels in turn, so that the groups have the same work.
    let l = lane.x * (LEVELS / 8u) + group.x;
    let level = levels[l];
    let odd = (l & 1u) == 1u;
    let count = select(0u, counters.kept, gradients_usable());
    for (var index = 0u; index < count; index++) {
        let both = d_encoding_load(index * (LEVELS / 2u) + l / 2u);
        let gradient = select(both.xy, both.zw, odd);
        let position = samples_load(kept_rows_load(index).x).xyz;
        gradient_scatter(position, level, gradient);
    }
}
