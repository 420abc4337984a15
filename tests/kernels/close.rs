//! The tolerance that all comparisons use.

/// Compares `got` with `want`, element by element: |got − want| ≤ abs + rel |want|, and finite.
///
/// Prints the worst error, and on failure its index, both values and how many are beyond the bound.
#[track_caller]
pub(crate) fn assert_close<G, W>(name: &str, got: &[G], want: &[W], abs: f64, rel: f64)
where
    G: Copy + Into<f64>,
    W: Copy + Into<f64>,
{
    assert_eq!(got.len(), want.len(), "{name}: number of values");
    let mut worst = (0.0, 0, 0.0, 0.0);
    let mut beyond = 0;
    for (index, (&got, &want)) in got.iter().zip(want).enumerate() {
        let (got, want): (f64, f64) = (got.into(), want.into());
        let error = (got - want).abs() / (abs + rel * want.abs()).max(f64::MIN_POSITIVE);
        let error = if error.is_nan() { f64::INFINITY } else { error };
        beyond += usize::from(error > 1.0);
        if error > worst.0 {
            worst = (error, index, got, want);
        }
    }
    let (error, index, got_there, want_there) = worst;
    let count = got.len();
    let scale = largest(want);
    let share = (got_there - want_there).abs() / scale;
    println!("{name:<44} {error:.4} of the bound; {share:.1e} of {scale:.1e}; {count} values");
    assert!(
        beyond == 0,
        "{name}: {beyond} of {count} values are off; the worst at {index}: got {got_there:e}, want \
         {want_there:e}, {error:.2} times what {abs:e} + {rel:e} |want| allows"
    );
}

/// The largest magnitude, at least 1e-30.
fn largest<T: Copy + Into<f64>>(values: &[T]) -> f64 {
    values.iter().fold(1e-30, |most, &value| most.max(value.into().abs()))
}
