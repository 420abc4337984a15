// Provides: gradients of the table where an adapter has no float atomics: a compare-exchange on the bits.

var<storage, read_write> d_table: array<atomic<u32>>;

fn gradient_add_scalar(index: u32, gradient: f32) {
    if gradient == 0.0 {
        return;
    }
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

fn gradient_add(entry: u32, gradient: vec2<f32>) {
    gradient_add_scalar(2u * entry, gradient.x);
    gradient_add_scalar(2u * entry + 1u, gradient.y);
}
