//! OpenCV's fisheye model, `θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)`, on the branch around the axis where
//! it grows, and up to the direction straight back.

use super::branch::{first_root, surely_positive};
use glam::{DVec2, DVec3};
use std::f64::consts::PI;

/// The unit direction imaged at `plane`; `None` beyond the rim.
pub(super) fn direction(k: &[f64; 4], plane: DVec2) -> Option<DVec3> {
    let radius = plane.length();
    let (sin, cos) = angle(k, radius)?.sin_cos();
    let around = if radius > 0.0 { plane / radius } else { DVec2::ZERO };
    Some(DVec3::new(sin * around.x, -sin * around.y, -cos))
}

/// Where a point other than the origin is imaged; `None` beyond the rim.
pub(super) fn image(k: &[f64; 4], point: DVec3) -> Option<DVec2> {
    let across = DVec2::new(point.x, -point.y);
    let theta = across.length().atan2(-point.z);
    // The direction straight back is a whole circle of the image.
    let around = across.try_normalize().unwrap_or(DVec2::X);
    is_within_rim(k, theta).then(|| radius(k, theta) * around)
}

/// Along the radius the image moves by the slope of θ_d, around the axis by `θ_d / sin θ`. See
/// [`super::Lens::stretch`].
pub(super) fn stretch(k: &[f64; 4], point: DVec3, spread: f64) -> Option<f64> {
    /// Angles between which both vary little, and how much more they may be in between.
    const ANGLES: u32 = 4;
    const BETWEEN: f64 = 1.15;
    /// Farther apart they may vary much.
    const MOST_SPREAD: f64 = 0.3;
    let theta = point.x.hypot(point.y).atan2(-point.z);
    let (low, high) = ((theta - spread).max(0.0), theta + spread);
    if spread > MOST_SPREAD || high >= PI || !is_within_rim(k, high) {
        return None;
    }
    let angles = (0..=ANGLES).map(|step| low + (high - low) * f64::from(step) / f64::from(ANGLES));
    let around = |theta: f64| if theta > 0.0 { radius(k, theta) / theta.sin() } else { 1.0 };
    Some(BETWEEN * angles.map(|theta| slope(k, theta).max(around(theta))).fold(0.0, f64::max))
}

/// See [`super::Lens::rim`].
pub(super) fn rim(k: &[f64; 4]) -> f64 {
    first_root(&slope_of_square(k), PI * PI).map_or(PI, f64::sqrt)
}

fn is_within_rim(k: &[f64; 4], theta: f64) -> bool {
    surely_positive(&slope_of_square(k), theta * theta) || theta <= rim(k)
}

/// The slope of θ_d, as a polynomial of θ².
fn slope_of_square(k: &[f64; 4]) -> [f64; 5] {
    [1.0, 3.0 * k[0], 5.0 * k[1], 7.0 * k[2], 9.0 * k[3]]
}

/// θ_d of the angle `theta`.
fn radius(k: &[f64; 4], theta: f64) -> f64 {
    let t2 = theta * theta;
    theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))))
}

/// Its derivative.
fn slope(k: &[f64; 4], theta: f64) -> f64 {
    let t2 = theta * theta;
    1.0 + t2 * (3.0 * k[0] + t2 * (5.0 * k[1] + t2 * (7.0 * k[2] + t2 * 9.0 * k[3])))
}

/// The angle imaged at the distance `target` from the principal point; `None` beyond the rim.
fn angle(k: &[f64; 4], target: f64) -> Option<f64> {
    let likely = solve(k, target, PI);
    let is_solution = |theta: f64| (radius(k, theta) - target).abs() <= 1e-14 * (1.0 + target);
    if is_solution(likely) && is_within_rim(k, likely) {
        return Some(likely);
    }
    let rim = rim(k);
    (target <= radius(k, rim)).then(|| solve(k, target, rim))
}

/// Newton's method for `radius(theta) = target` on `[0, high]`, where every step that leaves the interval that
/// is left becomes a bisection. It ends at the solution where the polynomial grows up to `high`.
fn solve(k: &[f64; 4], target: f64, high: f64) -> f64 {
    let (mut low, mut high) = (0.0, high);
    let mut theta = target.min(high);
    for _ in 0..100 {
        let miss = target - radius(k, theta);
        if miss > 0.0 {
            low = theta;
        } else {
            high = theta;
        }
        let newton = theta + miss / slope(k, theta);
        let next = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
        let moved = (next - theta).abs();
        theta = next;
        if moved <= f64::EPSILON * theta {
            break;
        }
    }
    theta
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rim_is_where_the_polynomial_turns() {
        assert_eq!(rim(&[0.0; 4]), PI);
        assert_eq!(rim(&[0.1, 0.02, 0.0, 0.0]), PI);
        // 1 - 0.3 θ² vanishes at 1.826; with θ⁴ a second root lies farther out.
        assert!((rim(&[-0.1, 0.0, 0.0, 0.0]) - (1.0f64 / 0.3).sqrt()).abs() < 1e-14);
        let quadratic = (0.75 - (0.75f64 * 0.75 - 0.4).sqrt()) / 0.2;
        assert!((rim(&[-0.25, 0.02, 0.0, 0.0]) - quadratic.sqrt()).abs() < 1e-13);
    }

    #[test]
    fn every_angle_up_to_the_rim_is_found_again() {
        let lenses = [
            [0.0; 4],
            [-0.02, 0.003, -0.0006, 0.00001],
            [-0.1, 0.0, 0.0, 0.0],
            [0.5, 0.3, 0.1, 0.05],
            [-0.25, 0.04, 0.0, 0.0],
            [-0.12, 0.09, -0.025, 0.0021],
        ];
        for k in lenses {
            let rim = rim(&k);
            for step in 0..=1000 {
                let theta = rim * f64::from(step) / 1000.0;
                let target = radius(&k, theta);
                let found = angle(&k, target).expect("within the rim");
                assert!((radius(&k, found) - target).abs() < 1e-14 * (1.0 + target), "{k:?} {theta}");
                assert!((found - theta).abs() < 1e-6, "{k:?} {theta} {found}");
            }
            assert_eq!(angle(&k, radius(&k, rim) * (1.0 + 1e-12) + 1e-12), None);
        }
        assert_eq!(angle(&[0.0; 4], f64::NAN), None);
    }
}
