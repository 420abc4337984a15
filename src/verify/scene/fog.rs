//! A ball of homogeneous fog with a linear colour gradient: absorption and emission in closed form.

use super::Hit;
use super::shape::ball_span;
use glam::DVec3;

/// Fog in a ball about the origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fog {
    /// Radius of the ball.
    pub radius: f64,
    /// Extinction per unit of length.
    pub density: f64,
    /// Linear colours at the lowest and the highest point of `axis` through the ball.
    pub colors: [DVec3; 2],
    /// Unit vector along which the colour changes.
    pub axis: DVec3,
}

impl Fog {
    /// What a ray sees; `direction` has unit length.
    ///
    /// Over a chord L, with `τ = σ L`: `α = 1 - exp(-τ)`, and the light that arrives comes from the mean depth
    /// `m = ∫ s σ exp(-σ s) ds / α = 1/σ - L exp(-τ) / α` behind the entry. As the colour is linear in the
    /// position, the mean of the colour is the colour at the mean depth. The gradient is taken between the end
    /// colours in linear light for `color_linear` and between their encoded values for `color_srgb`: linear
    /// in the space in which the images are composited.
    pub(super) fn trace(&self, origin: DVec3, direction: DVec3) -> Hit {
        let Some((enter, leave)) = ball_span(origin, direction, self.radius) else {
            return Hit::MISS;
        };
        let start = enter.max(0.0);
        let chord = leave - start;
        let alpha = -(-self.density * chord).exp_m1();
        if chord <= 0.0 || alpha <= 0.0 {
            return Hit::MISS;
        }
        let t = start + self.mean_depth(chord);
        let height = (origin + t * direction).dot(self.axis) / self.radius;
        let mix = (0.5 + 0.5 * height).clamp(0.0, 1.0);
        let [low, high] = self.colors;
        let encoded = self.colors.map(super::encode);
        Hit {
            color_linear: low.lerp(high, mix).to_array(),
            color_srgb: encoded[0].lerp(encoded[1], mix).to_array(),
            alpha,
            t,
        }
    }

    fn mean_depth(&self, chord: f64) -> f64 {
        let tau = self.density * chord;
        if tau < 1e-3 {
            // The series of the formula below, which cancels here; the next term is τ³/720.
            return chord * (0.5 - tau / 12.0);
        }
        1.0 / self.density - chord * (-tau).exp() / -(-tau).exp_m1()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fog(density: f64) -> Fog {
        let colors = [DVec3::new(0.9, 0.2, 0.1), DVec3::new(0.1, 0.3, 0.8)];
        Fog { radius: 1.0, density, colors, axis: DVec3::new(0.6, 0.0, 0.8) }
    }

    /// The radiance integral as a midpoint sum: `[r, g, b, α, ∫ t w dt]`.
    fn quadrature(fog: &Fog, origin: DVec3, direction: DVec3) -> [f64; 5] {
        let (enter, leave) = ball_span(origin, direction, fog.radius).expect("the ray meets the fog");
        let steps = 20_000;
        let step = (leave - enter) / f64::from(steps);
        let mut sum = [0.0; 5];
        for i in 0..steps {
            let depth = (f64::from(i) + 0.5) * step;
            let weight = fog.density * (-fog.density * depth).exp() * step;
            let height = (origin + (enter + depth) * direction).dot(fog.axis);
            let color = fog.colors[0].lerp(fog.colors[1], 0.5 + 0.5 * height);
            let terms = [color.x, color.y, color.z, 1.0, enter + depth];
            sum.iter_mut().zip(terms).for_each(|(s, term)| *s += weight * term);
        }
        sum
    }

    #[test]
    fn closed_form_matches_quadrature() {
        for density in [1e-4, 0.3, 2.0, 20.0] {
            let fog = fog(density);
            for aim in [DVec3::ZERO, DVec3::new(0.3, 0.4, 0.2), DVec3::new(0.0, 0.0, 0.99)] {
                let origin = DVec3::new(-4.0, 0.5, 0.0);
                let direction = (aim - origin).normalize();
                let hit = fog.trace(origin, direction);
                let want = quadrature(&fog, origin, direction);
                let got = [hit.color_linear[0], hit.color_linear[1], hit.color_linear[2], 1.0, hit.t];
                for (g, w) in got.map(|v| v * hit.alpha).iter().zip(want) {
                    assert!((g - w).abs() < 1e-6 * w.max(1e-3), "density {density}: {g} {w}");
                }
            }
        }
    }

    #[test]
    fn opacity_along_the_diameter() {
        let hit = fog(1.5).trace(DVec3::X * 3.0, -DVec3::X);
        assert!((hit.alpha - (1.0 - (-3.0_f64).exp())).abs() < 1e-15);
        assert_eq!(fog(1.5).trace(DVec3::new(3.0, 1.1, 0.0), -DVec3::X), Hit::MISS);
    }
}
