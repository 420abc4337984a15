// Provides: the ray at a longitude and latitude in radians.
// needs: camera, sine

const PI = 3.14159265;

fn equirectangular_ray(camera: Camera, plane: vec2<f32>) -> LensRay {
    let exists = abs(plane.x) <= PI && abs(plane.y) <= PI / 2.0;
    let at = clamp(plane, vec2(-PI), vec2(PI));
    let longitude = sine_cosine(at.x);
    let latitude = sine_cosine(-at.y);
    let direction = vec3(latitude.y * longitude.x, latitude.x, -latitude.y * longitude.y);
    return LensRay(vec2(0.0), direction, exists);
}
