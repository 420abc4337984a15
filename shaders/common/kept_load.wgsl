// Provides: the kept samples.

// Two for each sample: log-density, step length, optical depth left out in front of it, and its distance along the ray
// in sides of the inner cube where the loss has use for it; then its gains, how many times its own weight its colour
// has in both estimates.
tensor<read> kept_steps: vec4<f32>;

fn kept_step(i: u32) -> vec4<f32> {
    return kept_steps_load(2u * i);
}

fn kept_gains(i: u32) -> vec2<f32> {
    return kept_steps_load(2u * i + 1u).xy;
}
