// Adds the colours of a round to a view's rays, and writes the pixels of those that ended.
// Needs: counters, progress.

var<storage, read> counters: Counters;
var<storage, read> progress: Progress;
var<storage, read> ray_spans: array<vec2<u32>>;
var<storage, read> kept_spans: array<vec2<u32>>;
var<storage, read> view_slots: array<vec2<u32>>;
tensor<read> view_pixels: u32;
tensor<read> chosen: vec4<f32>;
tensor<read> color: vec4<f32>;
tensor<read> ray_states: vec4<f32>;
tensor<read_write> ray_colors: vec4<f32>;
// Of the band: premultiplied colour without background, and opacity.
var<storage, read_write> view_color: array<vec4<f32>>;
// Mean depth as the lens defines it, in box units; 0 where the opacity is below 1e-3.
var<storage, read_write> view_depth: array<f32>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays_used {
        return;
    }
    let pixel = view_pixels_load(index);
    if pixel == NO_PIXEL {
        return;
    }
    let first = ray_spans[index].x;
    let span = kept_spans[index];
    var sum = ray_colors_load(index).rgb;
    for (var i = 0u; i < span.y; i++) {
        sum += chosen_load(first + i).y * color_load(span.x + i).rgb;
    }
    if view_slots[index].y == 0u {
        ray_colors_store(index, vec4(sum, 0.0));
        return;
    }
    let state = ray_states_load(index);
    let alpha = state.y;
    // The share of the opacity that has no colour takes the mean one.
    if state.z > 0.0 && state.z < alpha {
        sum *= alpha / (alpha - state.z);
    }
    let at = pixel - progress.band_begin;
    view_color[at] = vec4(sum, alpha);
    view_depth[at] = select(0.0, state.w / max(alpha, 1e-6), alpha >= 1e-3);
}
