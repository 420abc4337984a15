// Provides: distance_store and sample_distance, the depth of a sample as the lens of a view defines it, in box units.
// needs: camera, lens, ray

var<uniform> view_camera: Camera;
var<storage, read_write> sample_distances: array<f32>;

fn distance_store(sample: u32, ray: Ray, t: f32) {
    sample_distances[sample] = lens_depth(view_camera, ray_at(ray, t) - view_camera.origin);
}

fn sample_distance(sample: u32) -> f32 {
    return sample_distances[sample];
}
