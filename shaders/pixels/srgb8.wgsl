// Provides: pixel_target for 8-bit images (straight alpha, kept in their display-referred values).

var<storage, read> pixels: array<u32>;

// Colour premultiplied by alpha, and alpha.
fn pixel_target(texel: u32) -> vec4<f32> {
    let color = unpack4x8unorm(pixels[texel]);
    return vec4(color.rgb * color.a, color.a);
}
