// Provides: distance_store and sample_distance, how far along its ray a sample lies, in sides of the inner cube. Where the
// hash grid has it does not tell: space may be bent.
// needs: ray

var<storage, read_write> sample_distances: array<f32>;

// That of the point that the networks see, as f32 has it. `zero` is 0, but only at run time: compilers may simplify
// (a + b) - a to b, and cannot where a + b went through it. There are fewer than 2^31 samples.
fn distance_store(sample: u32, ray: Ray, t: f32) {
    let zero = sample >> 31u;
    let seen = bitcast<vec3<f32>>(bitcast<vec3<u32>>(ray_at(ray, t)) ^ vec3(zero));
    sample_distances[sample] = dot(seen - ray.origin, ray.direction) * DENSITY_SCALE;
}

fn sample_distance(sample: u32) -> f32 {
    return sample_distances[sample];
}
