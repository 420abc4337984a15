//! OpenCV's radial-tangential model on the normalised image plane, y down, and its inverse.

use super::branch::{first_root, surely_positive};
use glam::{DMat2, DVec2};

/// Tangent beyond which a fold does not matter: that of 89.9 degrees.
const FARTHEST: f64 = 573.0;

/// Where the ideal point is imaged; `None` where the model folds over: a polynomial brings points far outside
/// the field of view back into the image.
pub(super) fn image(k: &[f64; 4], p: &[f64; 2], ideal: DVec2) -> Option<DVec2> {
    is_within_rim(k, p, ideal).then(|| distort(k, p, ideal))
}

/// See [`super::Lens::rim`].
pub(super) fn rim(k: &[f64; 4], p: &[f64; 2]) -> f64 {
    first_root(&least_slope(k, p), FARTHEST).unwrap_or(FARTHEST)
}

fn is_within_rim(k: &[f64; 4], p: &[f64; 2], ideal: DVec2) -> bool {
    let radius = ideal.length();
    surely_positive(&least_slope(k, p), radius) || radius <= rim(k, p)
}

/// How fast the image moves outwards with r, as a polynomial of r, in the direction where it does so least: there the
/// tangential terms take `6 |p| r` from the radial slope.
fn least_slope(k: &[f64; 4], p: &[f64; 2]) -> [f64; 9] {
    let tangential = 6.0 * p[0].hypot(p[1]);
    [1.0, -tangential, 3.0 * k[0], 0.0, 5.0 * k[1], 0.0, 7.0 * k[2], 0.0, 9.0 * k[3]]
}

/// From the ideal to the distorted point.
fn distort(k: &[f64; 4], p: &[f64; 2], ideal: DVec2) -> DVec2 {
    let r2 = ideal.length_squared();
    let radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * (k[2] + r2 * k[3])));
    let xy = ideal.x * ideal.y;
    ideal * radial
        + DVec2::new(
            2.0 * p[0] * xy + p[1] * (r2 + 2.0 * ideal.x * ideal.x),
            p[0] * (r2 + 2.0 * ideal.y * ideal.y) + 2.0 * p[1] * xy,
        )
}

/// From the distorted to the ideal point, the inverse of [`distort`] on the region around the optical axis
/// where the model is one-to-one; `None` for points that region does not reach.
pub(super) fn undistort(k: &[f64; 4], p: &[f64; 2], distorted: DVec2) -> Option<DVec2> {
    // The solution is followed from the axis (where ideal = distorted = 0) outwards, in one stride
    // for ordinary lenses and in shorter ones near a fold: Newton from the far end alone may land on
    // a branch beyond the fold.
    let mut ideal = DVec2::ZERO;
    let mut reached = 0.0;
    let mut stride = 1.0;
    while reached < 1.0 {
        let next = f64::min(reached + stride, 1.0);
        match newton(k, p, ideal, [distorted * reached, distorted * next]) {
            Some(solution) => {
                ideal = solution;
                reached = next;
                stride *= 2.0;
            }
            None => stride *= 0.5,
        }
        if stride < 1e-6 {
            return None;
        }
    }
    Some(ideal)
}

/// Solves `distort(x) = target` from the known solution `start` of `distort(start) = origin`, or
/// gives up when the solution is not safely on the branch of `start`.
fn newton(k: &[f64; 4], p: &[f64; 2], start: DVec2, [origin, target]: [DVec2; 2]) -> Option<DVec2> {
    let slope_at_start = jacobian(k, p, start);
    let predicted_step = slope_at_start.inverse() * (target - origin);
    let mut ideal = start + predicted_step;
    let mut last_step = f64::INFINITY;
    for _ in 0..12 {
        let slope = jacobian(k, p, ideal);
        let determinant = slope.determinant();
        if determinant.is_nan() || determinant <= 0.05 * slope_at_start.determinant() {
            return None;
        }
        let step = slope.inverse() * (target - distort(k, p, ideal));
        ideal += step;
        if ideal.distance(start + predicted_step) > 0.5 * predicted_step.length() + 1e-15 {
            return None;
        }
        let size = step.length();
        if size <= 4e-16 * (1.0 + ideal.length()) || (size >= last_step && size < 1e-13) {
            // Beyond the rim there may be a branch on which the Jacobian is positive again.
            return is_within_rim(k, p, ideal).then_some(ideal);
        }
        last_step = size;
    }
    None
}

/// Derivative of [`distort`].
fn jacobian(k: &[f64; 4], p: &[f64; 2], ideal: DVec2) -> DMat2 {
    let DVec2 { x, y } = ideal;
    let r2 = ideal.length_squared();
    let radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * (k[2] + r2 * k[3])));
    let d_radial = 2.0 * (k[0] + r2 * (2.0 * k[1] + r2 * (3.0 * k[2] + r2 * 4.0 * k[3])));
    let mixed = d_radial * x * y + 2.0 * (p[0] * x + p[1] * y);
    DMat2::from_cols(
        DVec2::new(radial + d_radial * x * x + 2.0 * p[0] * y + 6.0 * p[1] * x, mixed),
        DVec2::new(mixed, radial + d_radial * y * y + 6.0 * p[0] * y + 2.0 * p[1] * x),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beyond_the_rim_there_is_nothing() {
        // r (1 - 0.4 r²) peaks at r = 0.9129 with the value 0.6086.
        let undistort = |x: f64| undistort(&[-0.4, 0.0, 0.0, 0.0], &[0.0; 2], DVec2::new(x, 0.0));
        assert!(undistort(0.608).is_some());
        assert_eq!(undistort(0.609), None);
        assert_eq!(undistort(f64::NAN), None);
        // This one folds at 0.454 and grows again from 0.449 on, for ever.
        let unfolds = |x: f64| super::undistort(&[-0.9, 0.35, 0.0, 0.0], &[0.0; 2], DVec2::new(0.0, x));
        assert!(unfolds(0.452).is_some_and(|ideal| ideal.y < 0.79));
        assert!([0.46, 0.6, 1.0, 2.0, 9.0].into_iter().all(|x| unfolds(x).is_none()));
        assert_eq!(image(&[-0.4, 0.0, 0.0, 0.0], &[0.0; 2], DVec2::new(1.3, 0.0)), None);
    }

    #[test]
    fn the_jacobian_is_the_derivative() {
        let at = DVec2::new(0.31, -0.22);
        let lenses = [
            ([0.0578, -0.0805, 0.0, 0.0], [-9.8e-4, 1.6e-4]),
            ([-0.35, 0.15, -0.03, 0.0], [0.003, -0.002]),
            ([0.48, 0.9, 0.3, 0.1], [0.02, -0.01]),
        ];
        for (k, p) in lenses {
            let analytic = jacobian(&k, &p, at);
            for (axis, column) in [(DVec2::X, analytic.x_axis), (DVec2::Y, analytic.y_axis)] {
                let h = 1e-6;
                let slope = (distort(&k, &p, at + h * axis) - distort(&k, &p, at - h * axis)) / (2.0 * h);
                assert!(slope.distance(column) < 1e-8, "{k:?}");
            }
        }
    }
}
