// Provides: gradients of the table as 64-bit integers, by one atomic each: the sums of `fixed`.
// needs: fixed_scale

var<storage, read_write> d_table: array<atomic<i64>>;

fn gradient_add(entry: u32, feature: u32, gradient: f32) {
    let size = i64(round(gradient * power_of_two(gradient_scale_exponent())));
    if size != 0li {
        atomicAdd(&d_table[2u * entry + feature], size);
    }
}
