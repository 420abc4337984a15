// Hash-grid features of each sample, two levels per thread. Needs: counters, grid.

var<storage, read> counters: Counters;
var<storage, read> samples: array<vec4<f32>>;
var<storage, read> table: array<vec2<f32>>;
// `[samples, LEVELS / 2]`, the features of two levels in each.
var<storage, read_write> encoding: array<vec4<f32>>;

fn encode_level(position: vec3<f32>, level: Level) -> vec2<f32> {
    let cell = grid_cell(position, level);
    var feature = vec2(0.0);
    for (var corner = 0u; corner < 8u; corner++) {
        feature += grid_weight(cell, corner) * table[grid_entry(grid_corner(cell, corner), level)];
    }
    return feature;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>) {
    let index = id.x;
    if index >= counters.samples {
        return;
    }
    let position = samples[index].xyz;
    for (var pair = 0u; pair < LEVELS / 2u; pair++) {
        let low = encode_level(position, levels[2u * pair]);
        let high = encode_level(position, levels[2u * pair + 1u]);
        encoding[index * (LEVELS / 2u) + pair] = vec4(low, high);
    }
}
