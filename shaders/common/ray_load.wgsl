// Provides: the rays of this step.
// needs: ray

// Two for each ray: origin and t_near, direction and t_far.
tensor<read> ray_lines: vec4<f32>;

fn ray_load(index: u32) -> Ray {
    let origin = ray_lines_load(2u * index);
    let direction = ray_lines_load(2u * index + 1u);
    return Ray(origin.xyz, origin.w, direction.xyz, direction.w);
}

fn ray_direction(index: u32) -> vec3<f32> {
    return ray_lines_load(2u * index + 1u).xyz;
}
