// Adam on the hash table, two entries per thread. A parameter whose gradient is exactly zero was not touched
// by this batch: it and its moments stay. Needs: step, counters, adam, gradient.

var<storage, read> counters: Counters;
var<storage, read_write> table: array<vec4<f32>>;
var<storage, read_write> table_first: array<vec4<f32>>;
var<storage, read_write> table_second: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= TABLE_ENTRIES / 2u {
        return;
    }
    let rays = f32(counters.rays_used);
    let gradient = vec4(gradient_take(2u * index, rays), gradient_take(2u * index + 1u, rays));
    if all(gradient == vec4(0.0)) {
        return;
    }
    let old = Adam(table[index], table_first[index], table_second[index]);
    let updated = adam_update(old, gradient);
    let touched = gradient != vec4(0.0);
    table[index] = select(old.parameter, updated.parameter, touched);
    table_first[index] = select(old.first, updated.first, touched);
    table_second[index] = select(old.second, updated.second, touched);
}
