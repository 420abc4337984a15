// Needs: density. Provides: pack, what compositing needs of a chosen sample while training.

tensor<read> samples: vec4<f32>;
tensor<read> density_out: vec4<f32>;
// Log-density, step length, and optical depth left out in front of it.
tensor<write> kept_steps: vec4<f32>;
// Gains in both estimates.
tensor<write> kept_gains: vec2<f32>;

fn pack(row: u32, sample: u32, choice: vec4<f32>) {
    let log_density = density_log(density_out_load(sample * DENSITY_QUADS).x);
    kept_steps_store(row, vec4(log_density, samples_load(sample).w, choice.y, 0.0));
    kept_gains_store(row, choice.zw);
}
