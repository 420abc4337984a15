// Provides: the density activation; see `reference::activation`.

const LOG_DENSITY_MOST = 15.0;

// Log-density of the network's raw first output.
fn density_log(raw: f32) -> f32 {
    return min(raw, LOG_DENSITY_MOST);
}

// Gradient through the clamp: blocked only where it would push a clamped density further up.
fn density_log_backward(raw: f32, d_log_density: f32) -> f32 {
    return select(d_log_density, 0.0, raw > LOG_DENSITY_MOST && d_log_density < 0.0);
}
