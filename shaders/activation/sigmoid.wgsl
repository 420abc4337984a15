// Provides: the colour activation of LDR fields.
// needs: exp

fn color_activation(raw: vec3<f32>) -> vec3<f32> {
    let e = vec3(exp_accurate(-abs(raw.x)), exp_accurate(-abs(raw.y)), exp_accurate(-abs(raw.z)));
    return select(e, vec3(1.0), raw >= vec3(0.0)) / (1.0 + e);
}

// In terms of the activated colour.
fn color_activation_backward(color: vec3<f32>, d_color: vec3<f32>) -> vec3<f32> {
    return d_color * color * (1.0 - color);
}
