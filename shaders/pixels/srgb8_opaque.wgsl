// Provides: pixel_target for 8-bit images without alpha (kept in their display-referred values).

var<storage, read> pixels: array<u32>;

// Colour, and alpha 1.
fn pixel_target(texel: u32) -> vec4<f32> {
    return vec4(unpack4x8unorm(pixels[texel]).rgb, 1.0);
}
