//! OpenCV's fisheye model, `θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)`, on the branch around the axis where
//! it grows, and up to the direction straight back.

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
    (surely_grows(k, theta) || theta <= rim(k)).then(|| radius(k, theta) * around)
}

/// The largest angle that the lens images, in radians: where the polynomial stops growing, at most π.
pub(crate) fn rim(k: &[f64; 4]) -> f64 {
    if surely_grows(k, PI) {
        return PI;
    }
    let turns = roots(&[1.0, 3.0 * k[0], 5.0 * k[1], 7.0 * k[2], 9.0 * k[3]], PI * PI);
    turns.first().map_or(PI, |square| square.sqrt())
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

/// A quick test that passes far from a rim: whether bounds of the derivative on pieces of `[0, theta]` are
/// positive.
fn surely_grows(k: &[f64; 4], theta: f64) -> bool {
    const PIECES: u32 = 8;
    let square = |piece: u32| theta * theta * f64::from(piece) / f64::from(PIECES);
    (0..PIECES).all(|piece| {
        let (low, high) = (square(piece), square(piece + 1));
        let (mut least, mut low_power, mut high_power) = (1.0, 1.0, 1.0);
        for (factor, k) in [3.0, 5.0, 7.0, 9.0].into_iter().zip(k) {
            (low_power, high_power) = (low_power * low, high_power * high);
            least += factor * k * if *k > 0.0 { low_power } else { high_power };
        }
        least > 0.0
    })
}

/// The angle imaged at the distance `target` from the principal point; `None` beyond the rim.
fn angle(k: &[f64; 4], target: f64) -> Option<f64> {
    let likely = solve(k, target, PI);
    let is_solution = |theta: f64| (radius(k, theta) - target).abs() <= 1e-14 * (1.0 + target);
    if is_solution(likely) && surely_grows(k, likely) {
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

/// Where the polynomial with these coefficients (constant first) changes its sign in `(0, end)`, in order.
///
/// Between two such places of its derivative a polynomial changes its sign at most once.
fn roots(coefficients: &[f64], end: f64) -> Vec<f64> {
    let value = |x: f64| coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c);
    if coefficients.len() < 2 {
        return Vec::new();
    }
    let derivative: Vec<f64> =
        coefficients.iter().enumerate().skip(1).map(|(power, c)| power as f64 * c).collect();
    let mut stops = vec![0.0];
    stops.extend(roots(&derivative, end));
    stops.push(end);
    let changes = stops.windows(2).filter(|ends| (value(ends[0]) > 0.0) != (value(ends[1]) > 0.0));
    changes.map(|ends| bisect(value, ends[0], ends[1])).collect()
}

/// Where `value` changes its sign between `a` and `b`: the last number on the side of `a`.
fn bisect(value: impl Fn(f64) -> f64, mut a: f64, mut b: f64) -> f64 {
    let is_positive = value(a) > 0.0;
    loop {
        let middle = 0.5 * (a + b);
        if middle <= a || middle >= b {
            return a;
        }
        if (value(middle) > 0.0) == is_positive {
            a = middle;
        } else {
            b = middle;
        }
    }
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
        // (1 - u)² (1 + u / 4) = 1 - 1.75 u + 0.5 u² + 0.25 u³ touches zero: a little higher it has no root, a
        // little lower two.
        let near_touch = |lift: f64| roots(&[1.0 + lift, -1.75, 0.5, 0.25], 9.0);
        assert_eq!(near_touch(1e-9), Vec::<f64>::new());
        let [first, second] = near_touch(-1e-8)[..] else { panic!("two roots: {:?}", near_touch(-1e-8)) };
        assert!(first < 1.0 && second > 1.0 && second - first < 3e-4);
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
