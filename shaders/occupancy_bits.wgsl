// One bit per cell: occupied when its optical depth exceeds the threshold. Then all cells fade: those that neither a ray
// nor a visit raises again are empty after a while.
// needs: group

var<storage, read_write> occupancy: array<f32>;
var<storage, read> occupancy_mean: array<f32>;
tensor<write> occupancy_bits: u32;

@compute @workgroup_size(GROUP_SIZE)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = wide_index(id);
    if index >= CELL_COUNT / 32u {
        return;
    }
    let threshold = min(0.5 * occupancy_mean[0], OCCUPANCY_THRESHOLD);
    var word = 0u;
    for (var bit = 0u; bit < 32u; bit++) {
        let value = occupancy[index * 32u + bit];
        word |= select(0u, 1u << bit, value > threshold);
        occupancy[index * 32u + bit] = value * select(1.0, OCCUPANCY_DECAY, value > 0.0);
    }
    occupancy_bits_store(index, word);
}
