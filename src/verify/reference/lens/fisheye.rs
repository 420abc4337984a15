//! OpenCV's fisheye, `θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)`, and its inverse by bisection.

use super::bisect;
use std::f64::consts::PI;

/// Steps in which the angle is searched for the rim.
const STEPS: u32 = 4_000;

/// Coefficients k1..k4 of the lens.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fisheye {
    /// k1..k4.
    pub k: [f64; 4],
}

impl Fisheye {
    /// Where a ray at the angle `theta` from the axis is imaged: its distance from the principal point.
    pub fn radius(&self, theta: f64) -> f64 {
        let odd_powers = [3, 5, 7, 9].map(|power| theta.powi(power));
        theta + self.k.iter().zip(odd_powers).map(|(k, power)| k * power).sum::<f64>()
    }

    /// ∂radius/∂theta.
    pub fn slope(&self, theta: f64) -> f64 {
        let powers = [2, 4, 6, 8].map(|power| f64::from(power + 1) * theta.powi(power));
        1.0 + self.k.iter().zip(powers).map(|(k, power)| k * power).sum::<f64>()
    }

    /// The last angle up to which the radius grows, at most π.
    pub fn rim(&self) -> f64 {
        let angle = |step: u32| PI * f64::from(step) / f64::from(STEPS);
        match (1..=STEPS).find(|&step| self.slope(angle(step)) <= 0.0) {
            None => PI,
            Some(step) => bisect(angle(step - 1), angle(step), |theta| self.slope(theta) > 0.0),
        }
    }

    /// The angle that is imaged at `radius`; `None` beyond the rim.
    pub fn angle(&self, radius: f64) -> Option<f64> {
        let rim = self.rim();
        (radius <= self.radius(rim)).then(|| bisect(0.0, rim, |theta| self.radius(theta) < radius))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radius_and_slope_by_hand() {
        let lens = Fisheye { k: [0.1, -0.02, 0.003, -0.0004] };
        // 2 (1 + 0.4 - 0.32 + 0.192 - 0.1024) and 1 + 3 * 0.4 - 5 * 0.32 + 7 * 0.192 - 9 * 0.1024.
        assert!((lens.radius(2.0) - 2.3392).abs() < 1e-12);
        assert!((lens.slope(2.0) - 1.0224).abs() < 1e-12);
    }

    #[test]
    fn angles_end_at_the_rim() {
        let barrel = Fisheye { k: [-0.1, 0.0, 0.0, 0.0] };
        // θ - 0.1 θ³ is at most 1.2172, at θ = 1.8257.
        assert!((barrel.rim() - (1.0f64 / 0.3).sqrt()).abs() < 1e-12);
        assert!(barrel.angle(1.217).is_some() && barrel.angle(1.218).is_none());
        assert!(barrel.angle(f64::NAN).is_none());
        let angle = barrel.angle(barrel.radius(1.3)).expect("inside");
        assert!((angle - 1.3).abs() < 1e-12);
        assert!((Fisheye::default().angle(3.1).expect("inside") - 3.1).abs() < 1e-12);
    }
}
