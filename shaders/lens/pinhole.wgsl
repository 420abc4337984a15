// Provides: the ray of a lens without distortion.
// needs: camera

fn pinhole_ray(camera: Camera, plane: vec2<f32>) -> LensRay {
    return LensRay(vec2(0.0), vec3(plane.x, -plane.y, -1.0), true);
}
