// Provides: loss_weight of the relative squared error: dark colours of a linear scene count as much as bright ones.
// Its slope by the logarithm of the field's colour is bounded, and does not vanish where the field is far too dark; the
// weight is taken as a constant. See `reference::loss`.

// Weights of the squared errors of colour and opacity.
fn loss_weight(rendered: vec4<f32>, wanted: vec4<f32>) -> vec4<f32> {
    let squared = max(rendered.rgb, RELATIVE_DARKEST * wanted.rgb) * max(rendered.rgb, wanted.rgb);
    return vec4(1.0 / (squared + RELATIVE_FLOOR), 1.0);
}
