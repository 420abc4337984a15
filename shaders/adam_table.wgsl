// Adam on the hash table, two entries per thread. A parameter whose gradient is exactly zero was not touched by this
// batch: it and its moments stay.
// needs: adam, gradient_take, group

tensor<read_write> table: vec2<f32>;
// First moments of both features, then the second moments.
tensor<read_write> table_moments: vec4<f32>;

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = 2u * wide_index(id);
    if index >= TABLE_ENTRIES {
        return;
    }
    let gradient = vec4(gradient_take(index), gradient_take(index + 1u));
    let touched = gradient != vec4(0.0);
    if !any(touched) {
        return;
    }
    let parameter = vec4(table_load(index), table_load(index + 1u));
    let low = table_moments_load(index);
    let high = table_moments_load(index + 1u);
    let old = Adam(parameter, vec4(low.xy, high.xy), vec4(low.zw, high.zw));
    let updated = adam_update(old, gradient);
    let next = select(parameter, updated.parameter, touched);
    let first = select(old.first, updated.first, touched);
    let second = select(old.second, updated.second, touched);
    table_store(index, next.xy);
    table_store(index + 1u, next.zw);
    table_moments_store(index, vec4(first.xy, second.xy));
    table_moments_store(index + 1u, vec4(first.zw, second.zw));
}
