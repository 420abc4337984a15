// Provides: gradients of the table where an adapter has no float atomics: a compare-exchange on the bits.

var<storage, read_write> d_table: array<atomic<u32>>;

fn gradient_add(entry: u32, feature: u32, gradient: f32) {
    if gradient == 0.0 {
        return;
    }
    let index = 2u * entry + feature;
    var old = atomicLoad(&d_table[index]);
    loop {
        let sum = bitcast<u32>(bitcast<f32>(old) + gradient);
        let outcome = atomicCompareExchangeWeak(&d_table[index], old, sum);
        if outcome.exchanged {
            break;
        }
        old = outcome.old_value;
    }
}
