// Provides: background_color, one colour for all rays.

fn background_color(stream: u32, ray: u32) -> vec3<f32> {
    return BACKGROUND;
}
