// The colour network's input: the density network's outputs and the harmonics of the ray's direction.
// needs: counters, group, harmonics, ray_load

tensor<read> density_out: vec4<f32>;
tensor<read> kept_rows: vec2<u32>;
// `[kept, 8]`: 16 features, 16 harmonics.
tensor<write> color_input: vec4<f32>;

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.kept {
        return;
    }
    let kept = kept_rows_load(index);
    let sample = kept.x * DENSITY_QUADS;
    let terms = harmonics(ray_direction(kept.y));
    for (var i = 0u; i < 4u; i++) {
        color_input_store(index * 8u + i, density_out_load(sample + i));
    }
    color_input_store(index * 8u + 4u, terms[0]);
    color_input_store(index * 8u + 5u, terms[1]);
    color_input_store(index * 8u + 6u, terms[2]);
    color_input_store(index * 8u + 7u, terms[3]);
}
