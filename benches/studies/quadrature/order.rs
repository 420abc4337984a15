//! The measured order of convergence.

use serde::Serialize;

/// The error with some number of steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    /// Equal steps over a ray of length 1.
    pub(crate) steps: usize,
    /// What is left of the error.
    pub(crate) error: f64,
    /// The error below which something else than the step decides: rounding, or an early stop.
    pub(crate) rounding: f64,
}

/// The slope of an error over its asymptotic range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Order {
    /// `p` where the error falls as `h^p`.
    pub(crate) slope: f64,
    /// The fewest steps of the range.
    pub(crate) from: usize,
    /// The most steps of the range.
    pub(crate) to: usize,
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
pub(crate) fn order(points: &[Point], densest: f64) -> Option<Order> {
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
