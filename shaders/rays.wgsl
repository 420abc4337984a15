// One training ray per thread: a random pixel of a random image, its ray and its target.
// needs: background, camera, counters, depth_target, group, lens, pixels, position, random, ray_store, ray_target, step

var<storage, read> cameras: array<Camera>;
var<storage, read_write> ray_targets: array<RayTarget>;

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays {
        return;
    }
    let view = random_u32(step.stream, index, RANDOM_IMAGE) % CAMERA_COUNT;
    let camera = cameras[view];
    let drawn = random_u32(step.stream, index, RANDOM_PIXEL) % camera.pixel_count;
    let position = photo_position(camera.first_row, drawn);
    let pixel = vec2(f32(position % camera.width), f32(position / camera.width)) + 0.5;
    let ray = camera_ray(camera, pixel);
    ray_store(index, ray);
    let depth = depth_target(camera.first_row, drawn, 1.0 / max(lens_depth(camera, ray.direction), 1e-6));
    let color = photo_color(camera.first_row, drawn);
    let background = background_color(step.stream, index);
    let over = vec4(color.rgb + (1.0 - color.a) * background, color.a);
    ray_targets[index] = RayTarget(over, background, depth);
}
