// One ray per pixel of a view to render, a chunk of pixels at a time.
// Needs: step, counters, ray, camera, lens.

var<storage, read> counters: Counters;
var<storage, read> cameras: array<Camera>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays {
        return;
    }
    let camera = cameras[0];
    let texel = step.first_pixel + index;
    let pixel = vec2(f32(texel % camera.width), f32(texel / camera.width)) + 0.5;
    ray_store(index, camera_ray(camera, pixel));
}
