// Begins the rays of the next pixels of a view where slots are free.
// needs: camera, counters, group, progress, ray_store, view_ray

var<uniform> progress: Progress;
var<uniform> view_camera: Camera;
// How many free slots are in front of it, and 1 where the slot is free.
var<storage, read> view_slots: array<vec2<u32>>;
var<storage, read_write> view_rays: array<ViewRay>;
// Two for each ray: optical depth, opacity, that of the samples that have no colour yet, and the sum of weighted
// depths; then the sum of weighted colours.
tensor<write> ray_states: vec4<f32>;

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays || view_slots[index].y == 0u {
        return;
    }
    let pixel = progress.first_pixel + view_slots[index].x;
    if pixel >= progress.next_pixel {
        view_rays[index] = ViewRay(NO_PIXEL, MAX_STEPS, MAX_STEPS);
        return;
    }
    let center = vec2(f32(pixel % view_camera.width), f32(pixel / view_camera.width)) + 0.5;
    ray_store(index, camera_ray(view_camera, center));
    view_rays[index] = ViewRay(pixel, 0u, 0u);
    ray_states_store(2u * index, vec4(0.0));
    ray_states_store(2u * index + 1u, vec4(0.0));
}
