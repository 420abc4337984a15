// Provides: camera_ray, and depth along the view axis and along a ray.
// needs: lens, ray, space

struct Camera {
    // Position and axes in box space; `back` points away from the view.
    origin: vec3<f32>,
    width: u32,
    right: vec3<f32>,
    height: u32,
    up: vec3<f32>,
    // The photo's first row in the pages.
    first_row: u32,
    back: vec3<f32>,
    // Pixels that can be drawn, at least 1.
    pixel_count: u32,
    // Pixels per unit of the lens's plane: of the image plane at distance 1, per radian, or per box unit.
    focal_px: vec2<f32>,
    center_px: vec2<f32>,
    // k1..k4.
    radial: vec4<f32>,
    // p1, p2.
    tangential: vec2<f32>,
    // The kind of lens, for a kernel that links several.
    lens: u32,
    // Where the polynomial of the lens stops growing: an angle, or a distance on the undistorted plane.
    rim: f32,
}

// What a lens makes of a point of its plane, x to the right and y down.
struct LensRay {
    // Where the ray starts on the image plane, along `right` and `up`, in box units.
    start: vec2<f32>,
    // Along `right`, `up` and `back`, of any length but 0.
    direction: vec3<f32>,
    exists: bool,
}

// a / b with an error of half a unit where fma does not round in between: WGSL allows a quotient five times that,
// which is a ten-thousandth of a pixel at the sides of an image.
fn camera_quotient(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    let quotient = a / b;
    return quotient + fma(-quotient, b, a) / b;
}

// The ray through a pixel position; one that misses the box where the lens has no ray there.
fn camera_ray(camera: Camera, pixel: vec2<f32>) -> Ray {
    let seen = lens_ray(camera, camera_quotient(pixel - camera.center_px, camera.focal_px));
    let origin = camera.origin + camera.right * seen.start.x + camera.up * seen.start.y;
    let axes = mat3x3(camera.right, camera.up, camera.back);
    var ray = space_ray(origin, normalize(axes * seen.direction));
    if !seen.exists {
        ray.t_far = -1.0;
    }
    return ray;
}

// `toward` is a point seen from the camera's position.
fn depth_along_axis(camera: Camera, toward: vec3<f32>) -> f32 {
    return -dot(camera.back, toward);
}

fn depth_along_ray(camera: Camera, toward: vec3<f32>) -> f32 {
    return length(toward);
}
