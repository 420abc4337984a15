// Provides: loss_weight of the relative squared error: dark colours of a linear scene count as much as bright ones.
// The weight is taken as a constant, so gradients of different draws of a pixel average out (Mildenhall et al. 2022).

// Weights of the squared errors of colour and opacity.
fn loss_weight(rendered: vec4<f32>) -> vec4<f32> {
    return vec4(1.0 / (rendered.rgb * rendered.rgb + RELATIVE_FLOOR), 1.0);
}
