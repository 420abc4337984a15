//! Rays whose integrals are known, and the orders of both sums.

use super::studies::quadrature::medium::{Medium, Rms, Samples, phase};
use super::studies::quadrature::order::{Point, order};
use nerf::config::Transmittance;

const FINE: usize = 200_000;

/// The defining integrals as sums over very many steps, with none of the formulas of `exact` and `depth`.
#[test]
fn exact_values_are_the_integrals() {
    for medium in Medium::ALL {
        let delta = 1.0 / FINE as f64;
        let (mut depth, mut sum) = (0.0_f64, [0.0; 4]);
        for i in 0..FINE {
            let t = (i as f64 + 0.5) * delta;
            let tau = medium.density(t) * delta;
            let through = (-depth - 0.5 * tau).exp();
            assert!((depth + 0.5 * tau - medium.depth(t)).abs() < 1e-3, "{medium:?} at {t}");
            let [r, g, b] = medium.color(t);
            for (sum, c) in sum.iter_mut().zip([r, g, b, 1.0]) {
                *sum += through * tau * c;
            }
            depth += tau;
        }
        for (sum, exact) in sum.iter().zip(medium.exact()) {
            assert!((sum - exact).abs() < 2e-6, "{medium:?}: {sum} {exact}");
        }
        assert!((depth - medium.depth(1.0)).abs() < 1e-9 * depth);
    }
}

#[test]
fn media_are_empty_at_their_ends() {
    for medium in Medium::ALL {
        assert!(medium.depth(0.125) < 2e-9, "{medium:?}");
        assert!(medium.depth(1.0) - medium.depth(0.875) < 2e-9, "{medium:?}");
    }
}

fn curve(medium: Medium, convention: Transmittance, stop: f64) -> Vec<(Point, Point)> {
    let error = |steps: usize| {
        let rays = (0..64).map(|ray| Samples::new(medium, steps, phase(ray, 64)).render(convention, stop));
        let rms = Rms::of(rays.map(|ray| (ray, medium.exact())));
        let point = |error| Point { steps, error, rounding: 1e-13 };
        (point(rms.color), point(rms.opacity))
    };
    (2..=10).map(|power| error(1 << power)).collect()
}

/// Orders of colour and opacity, `None` without an asymptotic range.
fn orders(medium: Medium, convention: Transmittance) -> [Option<f64>; 2] {
    let (color, opacity): (Vec<_>, Vec<_>) = curve(medium, convention, 0.0).into_iter().unzip();
    [color, opacity].map(|points| order(&points, medium.densest()).map(|order| order.slope))
}

#[test]
fn orders_are_those_of_the_documentation() {
    let near = |order: Option<f64>, want: f64| {
        let found = order.expect("an asymptotic range");
        assert!((found - want).abs() < 0.15, "{found} and not {want}");
    };
    let [color, opacity] = orders(Medium::Bump, Transmittance::Exclusive);
    near(color, 2.0);
    assert_eq!(opacity, None, "rounding is reached before the range begins");
    let [color, opacity] = orders(Medium::Slab, Transmittance::Exclusive);
    near(color, 1.0);
    near(opacity, 1.0);
    for medium in [Medium::Bump, Medium::Slab] {
        near(orders(medium, Transmittance::Inclusive)[0], 1.0);
    }
    near(orders(Medium::Bump, Transmittance::Inclusive)[1], 1.0);
}

#[test]
fn a_wall_is_opaque_with_few_samples_only_in_the_exclusive_sum() {
    let opacity_error = |convention| curve(Medium::Wall, convention, 0.0)[1].1.error;
    assert!(opacity_error(Transmittance::Exclusive) < 1e-9);
    assert!(opacity_error(Transmittance::Inclusive) > 0.5);
}

#[test]
fn the_early_stop_costs_its_threshold_at_most() {
    let finest = |stop| curve(Medium::Slab, Transmittance::Exclusive, stop)[8].1.error;
    let (without, with) = (finest(0.0), finest(1e-4));
    assert!(with > 2e-5 && with < 1e-4 && without < with, "{without} {with}");
}
