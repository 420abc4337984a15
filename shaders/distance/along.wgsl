// Provides: sample_distance, how far along its ray a sample lies, in sides of the inner cube.
// needs: ray_load

fn sample_distance(ray: u32, position: vec3<f32>) -> f32 {
    let line = ray_load(ray);
    return dot(position - line.origin, line.direction) * DENSITY_SCALE;
}
