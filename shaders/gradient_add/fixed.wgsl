// Provides: gradients of the table as 64-bit integers, each in two 32-bit atomics, the lower half first. Sums of
// integers do not depend on their order.
// needs: fixed_scale

var<storage, read_write> d_table: array<atomic<u32>>;

fn gradient_add(entry: u32, feature: u32, gradient: f32) {
    let size = round(abs(gradient) * power_of_two(gradient_scale_exponent()));
    if size == 0.0 {
        return;
    }
    // Both halves are exact: a float has only 24 bits.
    let upper = floor(size * power_of_two(-32));
    var high = u32(upper);
    var low = u32(size - upper * power_of_two(32));
    if gradient < 0.0 {
        high = ~high + select(0u, 1u, low == 0u);
        low = ~low + 1u;
    }
    let index = 2u * (2u * entry + feature);
    let old = atomicAdd(&d_table[index], low);
    let carry = select(0u, 1u, old + low < old);
    // Where a small negative number crosses no zero, its upper half and the carry cancel.
    if high + carry != 0u {
        atomicAdd(&d_table[index + 1u], high + carry);
    }
}
