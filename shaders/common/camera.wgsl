// Needs: lens_undistort, ray_through_box. Provides: camera_ray.

struct Camera {
    // Position and axes in box space; `back` points away from the view.
    origin: vec3<f32>,
    width: u32,
    right: vec3<f32>,
    height: u32,
    up: vec3<f32>,
    // The photo's first row in the banks.
    first_row: u32,
    back: vec3<f32>,
    // Pixels that can be drawn, at least 1.
    pixel_count: u32,
    focal_px: vec2<f32>,
    center_px: vec2<f32>,
    radial: vec4<f32>,
    tangential: vec2<f32>,
    unused_2: vec2<f32>,
}

// The ray through a pixel position; one that misses the box where the lens has no ray there.
fn camera_ray(camera: Camera, pixel: vec2<f32>) -> Ray {
    let distorted = (pixel - camera.center_px) / camera.focal_px;
    let ideal = lens_undistort(distorted, camera.radial, camera.tangential);
    let direction = normalize(camera.right * ideal.x - camera.up * ideal.y - camera.back);
    var ray = ray_through_box(camera.origin, direction);
    if ideal.z == 0.0 {
        ray.t_far = -1.0;
    }
    return ray;
}
