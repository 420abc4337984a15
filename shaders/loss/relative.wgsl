// Provides: loss_weight of the relative squared error: dark colours of a linear scene count as much as bright ones.
// Relative to both colours, so that no error counts for more than 2, however bright the photo or the field; the weight
// is taken as a constant. See `reference::loss`.

// Weights of the squared errors of colour and opacity.
fn loss_weight(rendered: vec4<f32>, wanted: vec4<f32>) -> vec4<f32> {
    let both = 0.5 * (rendered.rgb * rendered.rgb + wanted.rgb * wanted.rgb);
    return vec4(1.0 / (both + RELATIVE_FLOOR), 1.0);
}
