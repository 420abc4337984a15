// What a ray's walk asks of each marched sample, for all of them at once: few threads walk, and each waits for the sample
// before.
// needs: counters, density, exp, group, marched, occupancy_raise, space

tensor<read> samples: vec4<f32>;
tensor<read> density_out: vec4<f32>;
// As `marched` packs it.
tensor<write> chosen: vec4<f32>;

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.samples {
        return;
    }
    let sample = samples_load(index);
    let log_density = density_log(density_out_load(index * DENSITY_QUADS).x);
    let tau = optical_depth(log_density, sample.w);
    let marched = Marched(tau, opacity(tau), occupancy_depth(log_density), space_cell(sample.xyz));
    chosen_store(index, marched_pack(marched));
}
