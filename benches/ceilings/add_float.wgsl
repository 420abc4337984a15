// Provides: add_one, by the adapter's own addition of floats.

var<storage, read_write> sums: array<atomic<f32>>;

fn add_one(index: u32) {
    atomicAdd(&sums[index], 1.0);
}
