// Provides: gradients of the table as two 32-bit fixed-point numbers in one 64-bit atomic. Sums do not depend
// on their order, and one locked operation serves both features.
// The sums are of gradients times 2 M, so that their range does not depend on the number of rays.

var<storage, read_write> d_table: array<atomic<u64>>;

const GRADIENT_MOST = 1e9;

fn gradient_add(entry: u32, gradient: vec2<f32>, rays: f32) {
    let scaled = clamp(gradient * (2.0 * rays * GRADIENT_SCALE), vec2(-GRADIENT_MOST), vec2(GRADIENT_MOST));
    let fixed = vec2<i32>(round(scaled));
    if fixed.x == 0 && fixed.y == 0 {
        return;
    }
    // The low half is sign-extended: what it borrows from the high half comes back when it is taken out.
    let packed = i64(fixed.x) + (i64(fixed.y) << 32u);
    atomicAdd(&d_table[entry], bitcast<u64>(packed));
}
