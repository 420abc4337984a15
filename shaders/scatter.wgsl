// The encoding's backward pass: adds each kept sample's gradient to the eight corners of its cells. One level
// per row of workgroups. Needs: counters, grid, gradient.

var<storage, read> counters: Counters;
var<storage, read> samples: array<vec4<f32>>;
var<storage, read> kept_sample: array<u32>;
var<storage, read> d_encoding: array<vec2<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= counters.kept {
        return;
    }
    let rays = f32(counters.rays_used);
    let position = samples[kept_sample[index]].xyz;
    for (var l = 0u; l < LEVELS; l++) {
        let level = levels[l];
        let gradient = d_encoding[index * LEVELS + l];
        if gradient.x == 0.0 && gradient.y == 0.0 {
            continue;
        }
        let cell = grid_cell(position, level);
        for (var corner = 0u; corner < 8u; corner++) {
            let entry = grid_entry(grid_corner(cell, corner), level);
            gradient_add(entry, grid_weight(cell, corner) * gradient, rays);
        }
    }
}
