//! The measured order of convergence.

use super::studies::quadrature::order::{Point, order};

fn points(error: impl Fn(f64) -> f64) -> Vec<Point> {
    let at = |steps: usize| Point { steps, error: error(1.0 / steps as f64), rounding: 1e-7 };
    (2..=10).map(|power| at(1 << power)).collect()
}

#[test]
fn powers_are_found_and_their_range_is_told() {
    let found = order(&points(|h| 3.0 * h * h), 20.0).expect("a range");
    assert!((found.slope - 2.0).abs() < 1e-12);
    assert_eq!((found.from, found.to), (64, 1024));
}

#[test]
fn rounding_and_coarse_steps_are_left_out() {
    let found = order(&points(|h| if h > 0.05 { 9.0 } else { 0.05 * h * h }), 10.0).expect("a range");
    assert!((found.slope - 2.0).abs() < 1e-12);
    assert_eq!((found.from, found.to), (32, 128));
    assert_eq!(order(&points(|h| 1e-4 * h * h), 20.0), None);
    assert_eq!(order(&points(|h| h), 300.0), None);
    assert_eq!(order(&[], 0.0), None);
}
