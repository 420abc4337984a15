// Provides: add_one to an integer of 32 bits.

var<storage, read_write> sums: array<atomic<u32>>;

fn add_one(index: u32) {
    atomicAdd(&sums[index], 1u);
}
