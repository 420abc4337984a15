// Provides: the ray of a camera whose rays are parallel; its plane has box units.
// needs: camera

fn orthographic_ray(camera: Camera, plane: vec2<f32>) -> LensRay {
    return LensRay(vec2(plane.x, -plane.y), vec3(0.0, 0.0, -1.0), true);
}
