// Provides: a ray in box space (the whole scene box is the unit cube).

struct Ray {
    origin: vec3<f32>,
    // Distance to the entry into the box, in box units; t_near >= t_far when the ray misses it.
    t_near: f32,
    // Unit vector.
    direction: vec3<f32>,
    t_far: f32,
}

// Slab test against the unit cube; zero components of the direction are replaced by tiny ones.
fn ray_through_box(origin: vec3<f32>, direction: vec3<f32>) -> Ray {
    let tiny = vec3(1e-20);
    let safe = select(direction, select(-tiny, tiny, direction >= vec3(0.0)), abs(direction) < tiny);
    let to_min = -origin / safe;
    let to_max = (1.0 - origin) / safe;
    let nearer = min(to_min, to_max);
    let farther = max(to_min, to_max);
    let t_near = max(max(nearer.x, nearer.y), max(nearer.z, T_NEAR));
    let t_far = min(farther.x, min(farther.y, farther.z));
    return Ray(origin, t_near, direction, t_far);
}

fn ray_at(ray: Ray, t: f32) -> vec3<f32> {
    return ray.origin + t * ray.direction;
}
