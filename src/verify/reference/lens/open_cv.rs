//! OpenCV's radial-tangential lens on the normalised image plane, y pointing down, and its inverse.
//!
//! ```text
//! x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸) + 2 p1 x y + p2 (r² + 2 x²)
//! y_d = y (1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸) + p1 (r² + 2 y²) + 2 p2 x y
//! ```

use super::bisect;
use glam::{DMat2, DVec2};

/// Residual, relative to `max(1, |distorted|)`, at which the inverse is found.
pub const TOLERANCE: f64 = 1e-14;
const MAX_ITERATIONS: u32 = 100;
const MAX_HALVINGS: u32 = 40;
/// The tangent of 89.9 degrees, beyond which it does not matter what a lens does.
const FARTHEST: f64 = 573.0;
/// Steps in which the rim is searched for, shorter near the centre.
const STEPS: u32 = 4_000;

/// Coefficients of the lens.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// Radial coefficients k1..k4.
    pub k: [f64; 4],
    /// Tangential coefficients p1, p2.
    pub p: [f64; 2],
}

impl Distortion {
    /// Where the lens images the undistorted point `point`.
    pub fn distort(&self, point: DVec2) -> DVec2 {
        let DVec2 { x, y } = point;
        let [p1, p2] = self.p;
        let rr = x * x + y * y;
        let radial = self.radial(rr);
        DVec2::new(
            x * radial + 2.0 * p1 * x * y + p2 * (rr + 2.0 * x * x),
            y * radial + p1 * (rr + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }

    /// ∂distorted/∂point, column by column.
    pub fn jacobian(&self, point: DVec2) -> DMat2 {
        let DVec2 { x, y } = point;
        let [k1, k2, k3, k4] = self.k;
        let [p1, p2] = self.p;
        let rr = x * x + y * y;
        let radial = self.radial(rr);
        let d_radial = k1 + rr * (2.0 * k2 + rr * (3.0 * k3 + rr * 4.0 * k4));
        let mixed = 2.0 * x * y * d_radial + 2.0 * p1 * x + 2.0 * p2 * y;
        let dx_dx = radial + 2.0 * x * x * d_radial + 2.0 * p1 * y + 6.0 * p2 * x;
        let dy_dy = radial + 2.0 * y * y * d_radial + 6.0 * p1 * y + 2.0 * p2 * x;
        DMat2::from_cols(DVec2::new(dx_dx, mixed), DVec2::new(mixed, dy_dy))
    }

    /// The distance from the centre up to which every point is imaged farther out than those between it and the
    /// centre, whatever the direction; at most the tangent of 89.9 degrees.
    pub fn rim(&self) -> f64 {
        // Tangential terms take most from the outward slope against (p2, p1).
        let outward = DVec2::new(-self.p[1], -self.p[0]).try_normalize().unwrap_or(DVec2::X);
        let grows = |radius: f64| outward.dot(self.jacobian(radius * outward) * outward) > 0.0;
        let radius = |step: u32| FARTHEST * (f64::from(step) / f64::from(STEPS)).powi(3);
        match (1..=STEPS).find(|&step| !grows(radius(step))) {
            None => FARTHEST,
            Some(step) => bisect(radius(step - 1), radius(step), grows),
        }
    }

    /// The point within the rim that the lens images at `distorted`, by Newton's method from the centre.
    ///
    /// A step is halved until it reduces the residual and stays within the rim. `None` if that does not lead to a
    /// solution: no point is imaged there.
    pub fn undistort(&self, distorted: DVec2) -> Option<DVec2> {
        let rim = self.rim();
        let tolerance = TOLERANCE * distorted.length().max(1.0);
        let mut point = DVec2::ZERO;
        let mut residual = self.distort(point) - distorted;
        for _ in 0..MAX_ITERATIONS {
            if residual.length() <= tolerance {
                return Some(point);
            }
            let mut step = self.jacobian(point).inverse() * residual;
            let mut halvings = 0;
            loop {
                let next = point - step;
                let next_residual = self.distort(next) - distorted;
                if next_residual.length() < residual.length() && next.length() <= rim {
                    (point, residual) = (next, next_residual);
                    break;
                }
                if halvings == MAX_HALVINGS {
                    return None;
                }
                step *= 0.5;
                halvings += 1;
            }
        }
        None
    }

    /// `1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸`, given `r²`.
    fn radial(&self, rr: f64) -> f64 {
        let [k1, k2, k3, k4] = self.k;
        1.0 + rr * (k1 + rr * (k2 + rr * (k3 + rr * k4)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENS: Distortion = Distortion { k: [-0.28, 0.07, -0.004, 0.001], p: [0.002, -0.001] };

    #[test]
    fn distortion_by_hand() {
        let lens = Distortion { k: [0.1, 0.01, 0.001, 0.0001], p: [0.01, 0.02] };
        // r² = 5, radial = 1 + 0.5 + 0.25 + 0.125 + 0.0625 = 1.9375.
        let distorted = lens.distort(DVec2::new(1.0, 2.0));
        assert!((distorted.x - (1.9375 + 0.04 + 0.02 * 7.0)).abs() < 1e-12);
        assert!((distorted.y - (3.875 + 0.01 * 13.0 + 0.08)).abs() < 1e-12);
    }

    #[test]
    fn undistort_inverts() {
        for i in -8..=8 {
            for j in -8..=8 {
                let point = DVec2::new(f64::from(i), f64::from(j)) * 0.1;
                let found = LENS.undistort(LENS.distort(point)).expect("within the lens");
                assert!((found - point).length() < 1e-12, "{point} {found}");
            }
        }
    }

    #[test]
    fn beyond_the_fold_there_is_nothing() {
        let barrel = Distortion { k: [-0.3, 0.0, 0.0, 0.0], p: [0.0; 2] };
        // r (1 − 0.3 r²) is at most 0.7027, at r = 1.054.
        assert!((barrel.rim() - (1.0f64 / 0.9).sqrt()).abs() < 1e-12);
        assert!(barrel.undistort(DVec2::new(0.70, 0.0)).is_some());
        assert!(barrel.undistort(DVec2::new(0.71, 0.0)).is_none());
        assert!(barrel.undistort(DVec2::new(f64::NAN, 0.0)).is_none());
    }
}
