// Provides: add_one to a float, by compare-exchange on its bits.

var<storage, read_write> sums: array<atomic<u32>>;

fn add_one(index: u32) {
    var old = atomicLoad(&sums[index]);
    loop {
        let outcome = atomicCompareExchangeWeak(&sums[index], old, bitcast<u32>(bitcast<f32>(old) + 1.0));
        if outcome.exchanged {
            break;
        }
        old = outcome.old_value;
    }
}
