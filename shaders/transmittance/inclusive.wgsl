// Provides: the inclusive sum, as the derivation prints it. T_i holds sample i itself.
// needs: exp, sum

// What T_i holds, from the optical depth before the sample and its own.
fn transmittance_depth(before: f32, tau: f32) -> f32 {
    return before + tau;
}

// dR/ds_i = tau * gradient_root^2 * gradient_color, from the roots of T_i and e^-tau, and B_i, the colour seen from
// just behind the sample.
fn gradient_root(transmittance_root: f32, passing_root: f32) -> f32 {
    return transmittance_root;
}

fn gradient_color(alpha: f32, color: vec4<f32>, behind: Sum) -> vec4<f32> {
    return sum_below((1.0 - 2.0 * alpha) * color, behind);
}

// What the sample adds to the colour seen from in front of it: B_{i-1} = alpha * own_color + e^-tau * B_i.
fn own_color(passing_root: f32, color: vec4<f32>, zero: u32) -> vec4<f32> {
    return squared_times(passing_root, color, zero);
}
