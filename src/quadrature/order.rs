//! The measured order of convergence.

use serde::Serialize;

/// The error with some number of steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Equal steps over a ray of length 1.
    pub steps: usize,
    /// What is left of the error.
    pub error: f64,
    /// The error below which something else than the step decides: rounding, or an early stop.
    pub rounding: f64,
}

/// The slope of an error over its asymptotic range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Order {
    /// `p` where the error falls as `h^p`.
    pub slope: f64,
    /// The fewest steps of the range.
    pub from: usize,
    /// The most steps of the range.
    pub to: usize,
}

/// Largest optical depth of a step in an asymptotic range.
const THICKEST: f64 = 0.5;
/// Fewest points of a range.
const FEWEST: usize = 3;
/// How far errors must be above their rounding.
const ABOVE_ROUNDING: f64 = 10.0;

/// The least-squares slope of `ln error` against `ln h` over the asymptotic range: where no step is
/// optically thick (`σ h ≤ 1/2` at the largest density), and the error at least ten times what rounding leaves.
/// `None` with fewer than three points in it.
#[must_use]
pub fn order(points: &[Point], densest: f64) -> Option<Order> {
    let is_asymptotic = |p: &&Point| {
        densest / p.steps as f64 <= THICKEST && p.error > ABOVE_ROUNDING * p.rounding && p.error > 0.0
    };
    let range: Vec<&Point> = points.iter().filter(is_asymptotic).collect();
    let (Some(first), Some(last), FEWEST..) = (range.first(), range.last(), range.len()) else { return None };
    let logs: Vec<(f64, f64)> = range.iter().map(|p| (-(p.steps as f64).ln(), p.error.ln())).collect();
    Some(Order { slope: slope(&logs), from: first.steps, to: last.steps })
}

/// Slope of the least-squares line through `(x, y)`.
fn slope(points: &[(f64, f64)]) -> f64 {
    let count = points.len() as f64;
    let (x, y) =
        points.iter().fold((0.0, 0.0), |sum, point| (sum.0 + point.0 / count, sum.1 + point.1 / count));
    let covariance: f64 = points.iter().map(|point| (point.0 - x) * (point.1 - y)).sum();
    covariance / points.iter().map(|point| (point.0 - x).powi(2)).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
