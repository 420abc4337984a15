// Provides: pixel_target for float images (scene-linear, premultiplied).

var<storage, read> pixels: array<vec4<f32>>;

// Colour premultiplied by alpha, and alpha.
fn pixel_target(texel: u32) -> vec4<f32> {
    return pixels[texel];
}
