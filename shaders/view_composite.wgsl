// Adds the colours of a round to a view's rays, and writes the pixels of those that ended.
// needs: counters, group, progress, view_ray

var<uniform> progress: Progress;
var<storage, read> ray_spans: array<vec2<u32>>;
var<storage, read> kept_spans: array<vec2<u32>>;
var<storage, read> view_slots: array<vec2<u32>>;
var<storage, read> view_rays: array<ViewRay>;
tensor<read> chosen: vec4<f32>;
tensor<read> color: vec4<f32>;
// As `view_rays` begins them.
tensor<read_write> ray_states: vec4<f32>;
// Of the band, five for each pixel: premultiplied colour without background, opacity, and mean depth as the lens defines
// it, in box units, 0 where the opacity is below 1e-3.
var<storage, read_write> view_pixels: array<f32>;

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays_used {
        return;
    }
    let pixel = view_rays[index].pixel;
    if pixel == NO_PIXEL {
        return;
    }
    let first = ray_spans[index].x;
    let span = kept_spans[index];
    var sum = ray_states_load(2u * index + 1u).rgb;
    for (var i = 0u; i < span.y; i++) {
        sum += chosen_load(first + i).y * color_load(span.x + i).rgb;
    }
    if view_slots[index].y == 0u {
        ray_states_store(2u * index + 1u, vec4(sum, 0.0));
        return;
    }
    let state = ray_states_load(2u * index);
    let alpha = state.y;
    // The share of the opacity that has no colour takes the mean one.
    if state.z > 0.0 && state.z < alpha {
        sum *= alpha / (alpha - state.z);
    }
    let at = 5u * (pixel - progress.band_begin);
    view_pixels[at] = sum.r;
    view_pixels[at + 1u] = sum.g;
    view_pixels[at + 2u] = sum.b;
    view_pixels[at + 3u] = alpha;
    view_pixels[at + 4u] = select(0.0, state.w / max(alpha, 1e-6), alpha >= 1e-3);
}
