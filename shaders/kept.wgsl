// Writes the chosen samples of all rays one behind the other. Several threads share those of a ray.
// needs: counters, group, packing

var<storage, read> ray_spans: array<vec2<u32>>;
var<storage, read> kept_spans: array<vec2<u32>>;
tensor<read> chosen: vec4<f32>;
// Sample and ray.
tensor<write> kept_rows: vec2<u32>;

@compute @workgroup_size(GROUP_SIZE, RAY_LANES)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let index = group.x * GROUP_SIZE + thread / RAY_LANES;
    if index >= counters.rays_used {
        return;
    }
    let first = ray_spans[index].x;
    let span = kept_spans[index];
    for (var i = thread % RAY_LANES; i < span.y; i += RAY_LANES) {
        let choice = chosen_load(first + i);
        kept_rows_store(span.x + i, vec2(u32(choice.x), index));
        pack(span.x + i, index, choice);
    }
}
