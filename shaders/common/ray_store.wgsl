// Provides: where the rays of this step go.
// needs: ray

// Two for each ray: origin and t_near, direction and t_far.
tensor<write> ray_lines: vec4<f32>;

fn ray_store(index: u32, ray: Ray) {
    ray_lines_store(2u * index, vec4(ray.origin, ray.t_near));
    ray_lines_store(2u * index + 1u, vec4(ray.direction, ray.t_far));
}
