// Provides: lens_undistort for a lens without distortion.

// xy: the ideal image-plane point; z: 1 where there is one.
fn lens_undistort(distorted: vec2<f32>, radial: vec4<f32>, tangential: vec2<f32>) -> vec3<f32> {
    return vec3(distorted, 1.0);
}
