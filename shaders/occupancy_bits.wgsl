// One bit per cell: occupied when its optical depth exceeds the threshold.

var<storage, read> occupancy: array<f32>;
var<storage, read> occupancy_mean: array<f32>;
tensor<write> occupancy_bits: u32;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let index = id.x;
    if index >= CELL_COUNT / 32u {
        return;
    }
    let threshold = min(occupancy_mean[0], OCCUPANCY_THRESHOLD);
    var word = 0u;
    for (var bit = 0u; bit < 32u; bit++) {
        let value = occupancy[index * 32u + bit];
        word |= select(0u, 1u << bit, value > threshold);
    }
    occupancy_bits_store(index, word);
}
