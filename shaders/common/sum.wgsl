// Provides: sums that lose nothing to rounding, however many terms they have (Kahan 1965).

struct Sum {
    value: vec4<f32>,
    // What rounding took from the value, with its sign turned.
    lost: vec4<f32>,
}

fn sum_of(value: vec4<f32>) -> Sum {
    return Sum(value, vec4(0.0));
}

// `zero` is 0, but only at run time: compilers may simplify (a + b) - a to b, and cannot where a + b went through it.
fn sum_add(sum: Sum, term: vec4<f32>, zero: u32) -> Sum {
    let corrected = term - sum.lost;
    let next = bitcast<vec4<f32>>(bitcast<vec4<u32>>(sum.value + corrected) ^ vec4(zero));
    return Sum(next, (next - sum.value) - corrected);
}

// value - sum, which loses nothing where both are nearly the same.
fn sum_below(value: vec4<f32>, sum: Sum) -> vec4<f32> {
    return (value - sum.value) + sum.lost;
}
