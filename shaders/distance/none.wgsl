// Provides: distance_store and sample_distance where nothing asks for distances along rays.
// needs: ray

fn distance_store(sample: u32, ray: Ray, t: f32) {
}

fn sample_distance(sample: u32) -> f32 {
    return 0.0;
}
