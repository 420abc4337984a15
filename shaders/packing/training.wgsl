// Provides: pack, what compositing needs of a chosen sample while training.
// needs: density, distance

tensor<read> samples: vec4<f32>;
tensor<read> density_out: vec4<f32>;
// As `kept_load` reads them.
tensor<write> kept_steps: vec4<f32>;

fn pack(row: u32, ray: u32, choice: vec4<f32>) {
    let sample = u32(choice.x);
    let log_density = density_log(density_out_load(sample * DENSITY_QUADS).x);
    let delta = samples_load(sample).w;
    kept_steps_store(2u * row, vec4(log_density, delta, choice.y, sample_distance(sample)));
    kept_steps_store(2u * row + 1u, vec4(choice.zw, 0.0, 0.0));
}
