//! The choice by hand, and its means over many draws against the whole ray.

use super::super::loss::{Loss, composite_with};
use super::super::random::{random_u32, uniform};
use super::*;

const S: [f64; 5] = [0.0, 1.0, 0.0, 3.0, 0.0];
const DELTA: [f64; 5] = [1e-5, 1.0, 1e-5, 1.0, 1.0];

fn kept(selection: Selection, luck: Luck) -> Vec<(usize, f64)> {
    let (kept, _) = select(&selection, &S, &DELTA, |_| luck);
    kept.iter().map(|kept| (kept.index, kept.gain)).collect()
}

/// Weights 10⁻⁵, 0.934, 6.6·10⁻⁷, 0.066; then T = e^{−e − e³} < 10⁻⁴ and the last is never reached.
#[test]
fn very_light_groups_are_kept_by_chance() {
    let selection = Selection { light_share: 0.1, floor: 1e-3, ..Selection::default() };
    let unlucky = kept(selection, Luck { member: 0.5, light: 0.2 });
    assert_eq!(unlucky.iter().map(|kept| kept.0).collect::<Vec<_>>(), [1, 3]);
    // What was left out is made up for.
    assert!(((unlucky[0].1 - 1.0) * 0.934_01 - 1e-5).abs() < 1e-9);
    let lucky = kept(selection, Luck { member: 0.5, light: 0.05 });
    assert_eq!(lucky.iter().map(|kept| kept.0).collect::<Vec<_>>(), [0, 1, 3]);
    assert!((lucky[0].1 - 10.0).abs() < 1e-3, "{lucky:?}");
    assert!(((lucky[1].1 - 1.0) * 0.934_01 + 9e-5).abs() < 1e-9);
}

#[test]
fn everything_is_kept_without_a_floor() {
    let all = kept(Selection { floor: 0.0, stop_transmittance: 0.0, ..Selection::default() }, UNLUCKY);
    assert_eq!(all, (0..5).map(|index| (index, 1.0)).collect::<Vec<_>>());
    assert!(select(&Selection::default(), &[], &[], |_| UNLUCKY).0.is_empty());
}

const UNLUCKY: Luck = Luck { member: 0.999, light: 0.999 };

/// Thin haze of 1000 equal samples: one in 50 carries the whole optical depth.
#[test]
fn opacity_is_kept() {
    let (s, delta) = (vec![0.0; 1000], vec![1e-4; 1000]);
    let (kept, reached) = select(&Selection::default(), &s, &delta, |index| luck(7, index));
    assert!((19..=20).contains(&kept.len()) && reached == 1000, "{}", kept.len());
    let mut gains = vec![0.0; 1000];
    kept.iter().for_each(|kept| gains[kept.index] = kept.gain);
    let ray = ray(&s, &delta, &[[1.0; 3]]);
    let thinned = thin(Transmittance::Exclusive, &ray.input(), &gains);
    assert!((thinned.rendered[3] - opacity(0.1)).abs() < 1e-12, "{:?}", thinned.rendered);
}

fn luck(draw: u32, index: usize) -> Luck {
    let number = |dimension| f64::from(uniform(random_u32(5, draw, index as u32, dimension)));
    Luck { member: number(0), light: number(1) }
}

struct Ray {
    s: Vec<f64>,
    delta: Vec<f64>,
    color: Vec<[f64; 3]>,
}

/// A ray whose samples have `colors` in turn.
fn ray(s: &[f64], delta: &[f64], colors: &[[f64; 3]]) -> Ray {
    let color = (0..s.len()).map(|i| colors[i % colors.len()]).collect();
    Ray { s: s.to_vec(), delta: delta.to_vec(), color }
}

impl Ray {
    fn input(&self) -> CompositeInput<'_> {
        CompositeInput {
            s: &self.s,
            delta: &self.delta,
            color: &self.color,
            target: [0.9, 0.1, 0.4, 1.0],
            background: [0.2, 0.5, 0.7],
            rays_in_batch: 1,
        }
    }
}

/// Thin fog, fog of which rays end, a wall behind fog, twelve decades of density, a single opaque sample.
fn rays() -> Vec<(&'static str, Ray)> {
    let colors = [[0.9, 0.2, 0.1], [0.1, 0.8, 0.3], [0.4, 0.4, 0.9], [0.0, 1.0, 0.0]];
    let spread = |count: usize, value: fn(f64) -> f64| -> Vec<f64> {
        (0..count).map(|i| value(i as f64 / count as f64)).collect()
    };
    let steps = |count| vec![4.0 / f64::from(count); count as usize];
    vec![
        ("thin fog", ray(&spread(120, |x| -3.0 + (9.0 * x).sin()), &steps(120), &colors)),
        ("dense fog", ray(&spread(120, |x| 1.0 + (20.0 * x).sin()), &steps(120), &colors)),
        ("wall", ray(&spread(80, |x| if x > 0.6 { 8.0 } else { -4.0 - x }), &steps(80), &colors)),
        ("decades", ray(&spread(60, |x| -20.0 + 28.0 * x), &steps(60), &colors)),
        ("opaque", ray(&[-6.0, -7.0, 9.0], &[0.1; 3], &colors)),
    ]
}

/// Over many draws, the rendered colour is that of the whole ray, the opacity is so in every draw but for what is
/// left at the end, and gradients are those of the whole ray but for the variance, which is of the order of the floor.
#[test]
fn the_mean_over_draws_is_the_whole_ray() {
    const DRAWS: u32 = 20_000;
    let selection = Selection { stop_transmittance: 0.0, floor: 0.02, light_share: 0.125 };
    for (name, ray) in rays() {
        let input = ray.input();
        let whole = composite_with(Loss::default(), Transmittance::Exclusive, &input, &[], &[]);
        let (mut rendered, mut loss) = ([0.0; 4], 0.0);
        let (mut d_s, mut d_color) = (vec![0.0; ray.s.len()], vec![[0.0; 3]; ray.s.len()]);
        let mut squares = [0.0; 4];
        for draw in 0..DRAWS {
            let mut gains = vec![0.0; ray.s.len()];
            let (kept, _) = select(&selection, &ray.s, &ray.delta, |index| luck(draw, index));
            kept.iter().for_each(|kept| gains[kept.index] = kept.gain);
            let drawn = composite_with(Loss::default(), Transmittance::Exclusive, &input, &[], &gains);
            let lost = (drawn.rendered[3] - whole.rendered[3]).abs();
            assert!(lost <= selection.floor * selection.light_share + 1e-12, "{name}: {lost} of the opacity");
            for x in 0..4 {
                rendered[x] += drawn.rendered[x] / f64::from(DRAWS);
                squares[x] += (drawn.rendered[x] - whole.rendered[x]).powi(2) / f64::from(DRAWS);
            }
            loss += drawn.loss / f64::from(DRAWS);
            for i in 0..ray.s.len() {
                d_s[i] += drawn.d_s[i] / f64::from(DRAWS);
                (0..3).for_each(|x| d_color[i][x] += drawn.d_color[i][x] / f64::from(DRAWS));
            }
        }
        let deviation = |x: usize| (squares[x] / f64::from(DRAWS)).sqrt();
        for x in 0..4 {
            let off = (rendered[x] - whole.rendered[x]).abs();
            assert!(off <= 4.0 * deviation(x) + 1e-12, "{name}: channel {x} is {off} off, {}", deviation(x));
            assert!(squares[x] <= selection.floor * 0.25, "{name}: a variance of {}", squares[x]);
        }
        let variance = squares.iter().sum::<f64>() / 4.0;
        assert!(
            (loss - whole.loss - variance).abs() < 1e-3,
            "{name}: loss {loss}, {} {variance}",
            whole.loss
        );
        // Sums over stretches of the ray: the gradient of a single light sample is rarely drawn.
        let size: f64 = whole.d_s.iter().map(|d| d.abs()).sum::<f64>() + 1e-3;
        for stretch in 0..4 {
            let range = ray.s.len() * stretch / 4..ray.s.len() * (stretch + 1) / 4;
            let sum = |values: &[f64]| values[range.clone()].iter().sum::<f64>();
            let off = (sum(&d_s) - sum(&whole.d_s)).abs();
            assert!(off < 0.02 * size, "{name}: by density in stretch {stretch}: {off} of {size}");
            for x in 0..3 {
                let sum = |colors: &[[f64; 3]]| colors[range.clone()].iter().map(|c| c[x]).sum::<f64>();
                let off = (sum(&d_color) - sum(&whole.d_color)).abs();
                assert!(off < 0.01, "{name}: by colour in stretch {stretch}: {off}");
            }
        }
    }
}
