// Provides: background_color, a colour drawn per ray and step.
// needs: random

fn background_color(stream: u32, ray: u32) -> vec3<f32> {
    return vec3(
        random_f32(stream, ray, RANDOM_BACKGROUND),
        random_f32(stream, ray, RANDOM_BACKGROUND + 1u),
        random_f32(stream, ray, RANDOM_BACKGROUND + 2u),
    );
}
