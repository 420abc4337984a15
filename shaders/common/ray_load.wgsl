// Needs: ray. Provides: the rays of this step.

// Origin and t_near, direction and t_far.
tensor<read> ray_origins: vec4<f32>;
tensor<read> ray_directions: vec4<f32>;

fn ray_load(index: u32) -> Ray {
    let origin = ray_origins_load(index);
    let direction = ray_directions_load(index);
    return Ray(origin.xyz, origin.w, direction.xyz, direction.w);
}
