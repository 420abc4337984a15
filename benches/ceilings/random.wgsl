// Provides: random_index, anywhere below a power of two.

fn random_index(thread: u32, round: u32) -> u32 {
    var x = (thread * ROUNDS + round) * 747796405u + 2891336453u;
    x = ((x >> ((x >> 28u) + 4u)) ^ x) * 277803737u;
    return ((x >> 22u) ^ x) & INDEX_MASK;
}
