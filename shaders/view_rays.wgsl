// Begins the rays of the next pixels of a view where slots are free.
// Needs: counters, progress, ray, camera, lens.

var<storage, read> counters: Counters;
var<storage, read> progress: Progress;
var<storage, read> cameras: array<Camera>;
// How many free slots are in front of it, and 1 where the slot is free.
var<storage, read> view_slots: array<vec2<u32>>;
// The pixel of each slot's ray; NO_PIXEL where there is none.
tensor<write> view_pixels: u32;
var<storage, read_write> ray_rounds: array<vec2<u32>>;
// Optical depth, opacity, that of the samples that have no colour yet, and the sum of weighted depths.
tensor<write> ray_states: vec4<f32>;
// Sum of the weighted colours.
tensor<write> ray_colors: vec4<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays || view_slots[index].y == 0u {
        return;
    }
    let pixel = progress.first_pixel + view_slots[index].x;
    if pixel >= progress.next_pixel {
        view_pixels_store(index, NO_PIXEL);
        ray_rounds[index] = vec2(MAX_STEPS);
        return;
    }
    let camera = cameras[0];
    let center = vec2(f32(pixel % camera.width), f32(pixel / camera.width)) + 0.5;
    ray_store(index, camera_ray(camera, center));
    view_pixels_store(index, pixel);
    ray_rounds[index] = vec2(0u);
    ray_states_store(index, vec4(0.0));
    ray_colors_store(index, vec4(0.0));
}
