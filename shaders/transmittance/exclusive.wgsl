// Provides: the exclusive sum. T_i holds what lies before sample i.

// T_i from the optical depth before the sample and its own.
fn transmittance_at(before: f32, tau: f32) -> f32 {
    return exp_accurate(-before);
}

// dR/ds_i, with B_i the colour seen from just behind the sample.
fn d_log_density(tau: f32, alpha: f32, passing: f32, transmittance: f32, color: vec4<f32>, behind: vec4<f32>) -> vec4<f32> {
    return tau * passing * transmittance * (color - behind);
}

// B_{i-1} from B_i.
fn seen_through(alpha: f32, passing: f32, color: vec4<f32>, behind: vec4<f32>) -> vec4<f32> {
    return alpha * color + passing * behind;
}
