// Provides: distance_store and sample_distance, how far along its ray a sample lies, in sides of the inner cube. Where the
// hash grid has it does not tell: space may be bent.
// needs: ray

var<storage, read_write> sample_distances: array<f32>;

fn distance_store(sample: u32, ray: Ray, t: f32) {
    sample_distances[sample] = dot(ray_at(ray, t) - ray.origin, ray.direction) * DENSITY_SCALE;
}

fn sample_distance(sample: u32) -> f32 {
    return sample_distances[sample];
}
