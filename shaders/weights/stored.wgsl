// Provides: weight_store, for checks against the reference.

var<storage, read_write> weights: array<f32>;

fn weight_store(index: u32, weight: f32) {
    weights[index] = weight;
}
