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

fn gradient_add(entry: u32, gradient: vec2<f32>, rays: f32) {
    gradient_add_scalar(2u * entry, gradient.x);
    gradient_add_scalar(2u * entry + 1u, gradient.y);
}

// Reads and clears.
fn gradient_take(entry: u32, rays: f32) -> vec2<f32> {
    let bits = vec2(atomicLoad(&d_table[2u * entry]), atomicLoad(&d_table[2u * entry + 1u]));
    if bits.x != 0u || bits.y != 0u {
        atomicStore(&d_table[2u * entry], 0u);
        atomicStore(&d_table[2u * entry + 1u], 0u);
    }
    return bitcast<vec2<f32>>(bits);
}
