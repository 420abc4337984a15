// Provides: the colour activation of HDR fields.
// needs: exp

const LOG_COLOR_MOST = 11.5;

fn color_activation(raw: vec3<f32>) -> vec3<f32> {
    let bounded = min(raw, vec3(LOG_COLOR_MOST));
    return vec3(exp_accurate(bounded.x), exp_accurate(bounded.y), exp_accurate(bounded.z));
}

// In terms of the activated colour; blocked only where it would push a clamped colour further up.
fn color_activation_backward(color: vec3<f32>, d_color: vec3<f32>) -> vec3<f32> {
    let clamped = color >= vec3(exp_accurate(LOG_COLOR_MOST));
    return select(d_color * color, vec3(0.0), clamped & (d_color < vec3(0.0)));
}
