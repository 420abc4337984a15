// Needs: ray. Provides: where the rays of this step go.

// Origin and t_near, direction and t_far.
tensor<write> ray_origins: vec4<f32>;
tensor<write> ray_directions: vec4<f32>;

fn ray_store(index: u32, ray: Ray) {
    ray_origins_store(index, vec4(ray.origin, ray.t_near));
    ray_directions_store(index, vec4(ray.direction, ray.t_far));
}
