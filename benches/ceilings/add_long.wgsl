// Provides: add_one to an integer of 64 bits.

var<storage, read_write> sums: array<atomic<u64>>;

fn add_one(index: u32) {
    atomicAdd(&sums[index], 1lu);
}
