// Provides: what a training ray showed.

struct RayResult {
    // Colour over the background, and opacity.
    rendered: vec4<f32>,
    // Squared errors of the four channels with their weights; opacity's also holds what the further terms add.
    errors: vec4<f32>,
}
