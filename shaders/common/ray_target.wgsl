// Provides: what a training ray should show.

struct RayTarget {
    // Colour composited over the background, and opacity.
    color: vec4<f32>,
    background: vec3<f32>,
    // Distance in sides of the inner cube; 0 where unknown.
    depth: f32,
}
