// Writes the chosen samples of all rays one behind the other.
// needs: counters, group, packing

var<storage, read> ray_spans: array<vec2<u32>>;
var<storage, read> kept_spans: array<vec2<u32>>;
tensor<read> chosen: vec4<f32>;
// Sample and ray.
tensor<write> kept_rows: vec2<u32>;

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.rays_used {
        return;
    }
    let first = ray_spans[index].x;
    let span = kept_spans[index];
    for (var i = 0u; i < span.y; i++) {
        let choice = chosen_load(first + i);
        kept_rows_store(span.x + i, vec2(u32(choice.x), index));
        pack(span.x + i, index, choice);
    }
}
