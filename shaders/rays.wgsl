// One training ray per thread: a random pixel of a random image, its ray and its target.
// Needs: random, step, counters, ray, camera, lens, photos_word, pixels, position, depth_target, background.

var<storage, read> counters: Counters;
var<storage, read> cameras: array<Camera>;
// Target colour composited over the background, and target opacity.
var<storage, read_write> targets: array<vec4<f32>>;
var<storage, read_write> backgrounds: array<vec4<f32>>;

@compute @workgroup_size(64)
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
    depth_target_store(index, camera.first_row, drawn, 1.0 / max(lens_depth(camera, ray.direction), 1e-6));
    let color = photo_color(camera.first_row, drawn);
    let background = background_color(step.stream, index);
    targets[index] = vec4(color.rgb + (1.0 - color.a) * background, color.a);
    backgrounds[index] = vec4(background, 0.0);
}
