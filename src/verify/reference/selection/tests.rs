//! The choice by hand, and the means of its estimates over many draws against the whole ray.

use super::super::composite::CompositeOutput;
use super::super::loss::{Loss, Places, composite_with};
use super::super::random::{random_u32, uniform};
use super::*;

const S: [f64; 5] = [0.0, 1.0, 0.0, 3.0, 0.0];
const DELTA: [f64; 5] = [1e-5, 1.0, 1e-5, 1.0, 1.0];

fn kept(selection: Selection, luck: impl Fn(usize) -> Luck) -> Vec<(usize, [f64; 2])> {
    let (kept, _) = select(&selection, &S, &DELTA, luck);
    kept.iter().map(|kept| (kept.index, kept.gains)).collect()
}

const UNLUCKY: Luck = Luck { member: [0.999; 2], light: [0.999; 2] };

/// Weights 10⁻⁵, 0.934, 6.6·10⁻⁷, 0.066; then T = e^{−e − e³} < 10⁻⁴ and the last is never reached.
#[test]
fn very_light_groups_are_kept_by_chance() {
    let selection = Selection { light_share: 0.1, floor: 1e-3, ..Selection::default() };
    let one_is_lucky = kept(selection, |_| Luck { member: [0.5; 2], light: [0.2, 0.05] });
    assert_eq!(one_is_lucky.iter().map(|kept| kept.0).collect::<Vec<_>>(), [0, 1, 3]);
    // In the first estimate it is left out, and made up for by the next sample.
    let [first, next, _] = one_is_lucky[..] else { panic!("{one_is_lucky:?}") };
    assert_eq!(first.1[0], 0.0);
    assert!(((next.1[0] - 1.0) * 0.934_01 - 1e-5).abs() < 1e-9);
    // In the second it stands for 10⁻⁴.
    assert!((first.1[1] - 10.0).abs() < 1e-3, "{one_is_lucky:?}");
    assert!(((next.1[1] - 1.0) * 0.934_01 + 9e-5).abs() < 1e-9);
    let unlucky = kept(selection, |_| Luck { member: [0.5; 2], light: [0.2; 2] });
    assert_eq!(unlucky.iter().map(|kept| kept.0).collect::<Vec<_>>(), [1, 3]);
}

#[test]
fn everything_is_kept_without_a_floor() {
    let all = kept(Selection { floor: 0.0, stop_transmittance: 0.0, ..Selection::default() }, |_| UNLUCKY);
    assert_eq!(all, (0..5).map(|index| (index, [1.0; 2])).collect::<Vec<_>>());
    assert!(select(&Selection::default(), &[], &[], |_| UNLUCKY).0.is_empty());
}

/// Five equal light samples: three reach twice the floor, two are left. Of the three the estimates draw different
/// members, of the two the same.
#[test]
fn estimates_draw_their_own_members() {
    let selection = Selection { floor: 1e-3, ..Selection::default() };
    for (first, second) in [([0.6, 0.4], [[3.0, 0.0], [0.0, 3.0]]), ([0.4, 0.6], [[0.0, 3.0], [3.0, 0.0]])] {
        let luck = |index: usize| Luck {
            member: [first, [0.9; 2], [0.9; 2], [0.3; 2]][index.max(1) - 1],
            light: [0.0; 2],
        };
        let (kept, reached) = select(&selection, &[0.0; 5], &[0.7e-3; 5], luck);
        let want = [(0, second[0]), (1, second[1]), (4, [2.0; 2])];
        assert_eq!((kept.len(), reached), (3, 5), "{kept:?}");
        for (kept, (index, gains)) in kept.iter().zip(want) {
            assert_eq!(kept.index, index);
            assert!((0..2).all(|e| (kept.gains[e] - gains[e]).abs() < 5e-3), "{kept:?}");
        }
    }
}

/// Thin haze of 1000 equal samples: of each hundred, either estimate has one that carries the whole optical depth.
#[test]
fn opacity_is_kept() {
    let (s, delta) = (vec![0.0; 1000], vec![1e-4; 1000]);
    let (kept, reached) = select(&Selection::default(), &s, &delta, |index| luck(7, index));
    let of = |estimate: usize| kept.iter().filter(|kept| kept.gains[estimate] > 0.0).count();
    assert!((9..=10).contains(&of(0)) && (9..=10).contains(&of(1)) && reached == 1000, "{kept:?}");
    let ray = ray(&s, &delta, &[[1.0; 3]]);
    let gains = gains(&kept, 1000);
    for estimate in 0..2 {
        let gains: Vec<f64> = gains.iter().map(|gains| gains[estimate]).collect();
        let thinned = thin(Transmittance::Exclusive, &ray.input(), &gains);
        assert!((thinned.rendered[3] - opacity(0.1)).abs() < 1e-12, "{:?}", thinned.rendered);
    }
}

fn luck(draw: u32, index: usize) -> Luck {
    let number = |dimension| f64::from(uniform(random_u32(5, draw, index as u32, dimension)));
    Luck { member: [number(0), number(1)], light: [number(2), number(3)] }
}

/// Of each of `samples` samples.
fn gains(kept: &[Kept], samples: usize) -> Vec<[f64; 2]> {
    let mut gains = vec![[0.0; 2]; samples];
    kept.iter().for_each(|kept| gains[kept.index] = kept.gains);
    gains
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

/// Means of numbers that are drawn many times, and how far off they may be.
#[derive(Default)]
struct Means {
    draws: f64,
    sums: Vec<f64>,
    squares: Vec<f64>,
}

impl Means {
    fn add(&mut self, values: &[f64]) {
        self.draws += 1.0;
        self.sums.resize(values.len(), 0.0);
        self.squares.resize(values.len(), 0.0);
        for (i, value) in values.iter().enumerate() {
            self.sums[i] += value;
            self.squares[i] += value * value;
        }
    }

    fn variance(&self, i: usize) -> f64 {
        self.squares[i] / self.draws - (self.sums[i] / self.draws).powi(2)
    }

    /// Whether the mean is `want`, up to `tolerance` and four standard errors.
    fn holds(&self, i: usize, want: f64, tolerance: f64, name: &str) {
        let (mean, error) = (self.sums[i] / self.draws, (self.variance(i).max(0.0) / self.draws).sqrt());
        let off = (mean - want).abs();
        assert!(
            off <= 4.0 * error + tolerance,
            "{name}: {mean:e} instead of {want:e}, give or take {error:e}"
        );
    }
}

const FLOOR: f64 = 0.02;
const SELECTION: Selection = Selection { stop_transmittance: 0.0, floor: FLOOR, light_share: 0.125 };

/// Colour and opacity, loss, and gradients summed over four stretches of the ray: by density, and by each colour. The
/// gradient of a single light sample is rarely drawn.
fn results(output: &CompositeOutput) -> Vec<f64> {
    let mut results = output.rendered.to_vec();
    results.push(output.loss);
    let samples = output.d_s.len();
    for stretch in 0..4 {
        let range = samples * stretch / 4..samples * (stretch + 1) / 4;
        results.push(output.d_s[range.clone()].iter().sum());
        results.extend((0..3).map(|x| output.d_color[range.clone()].iter().map(|c| c[x]).sum::<f64>()));
    }
    results
}

/// Over many draws, colour, loss and gradients by colour are those of the whole ray. The opacity is so in every draw,
/// but for what the roulette has left at the end; the gradient by density but for the colours within a group.
#[test]
fn the_mean_over_draws_is_the_whole_ray() {
    for (name, ray) in rays() {
        let (input, samples) = (ray.input(), ray.s.len());
        let composited = |gains: &[[f64; 2]]| {
            composite_with(Loss::default(), Transmittance::Exclusive, &input, Places::default(), gains)
        };
        let whole = composited(&[]);
        let want = results(&whole);
        let mut means = Means::default();
        for draw in 0..10_000 {
            let (kept, _) = select(&SELECTION, &ray.s, &ray.delta, |index| luck(draw, index));
            let drawn = composited(&gains(&kept, samples));
            let lost = (drawn.rendered[3] - whole.rendered[3]).abs();
            assert!(lost <= FLOOR * SELECTION.light_share + 1e-12, "{name}: {lost} of the opacity");
            means.add(&results(&drawn));
        }
        let size: f64 = whole.d_s.iter().map(|d| d.abs()).sum::<f64>() + 1e-3;
        for (i, &want) in want.iter().enumerate() {
            let is_by_density = i >= 5 && (i - 5) % 4 == 0;
            let tolerance = if is_by_density { 0.01 * size } else { 1e-12 };
            means.holds(i, want, tolerance, &format!("{name}, result {i}"));
        }
        // Of the mean of two estimates.
        let variance = (0..4).map(|x| means.variance(x)).fold(0.0, f64::max);
        assert!(variance <= 3.0 * FLOOR * 0.25 / 2.0, "{name}: a variance of {variance}");
    }
}

/// The square of one estimate's error is too large by its variance, the product of two is not.
#[test]
fn the_square_of_one_estimate_holds_its_variance() {
    let (_, ray) = &rays()[0];
    let input = ray.input();
    let whole = thin(Transmittance::Exclusive, &input, &vec![1.0; ray.s.len()]).rendered;
    let mut means = Means::default();
    for draw in 0..10_000 {
        let (kept, _) = select(&SELECTION, &ray.s, &ray.delta, |index| luck(draw, index));
        let gains = gains(&kept, ray.s.len());
        let error = |estimate: usize| {
            let gains: Vec<f64> = gains.iter().map(|gains| gains[estimate]).collect();
            thin(Transmittance::Exclusive, &input, &gains).rendered[0] - input.target[0]
        };
        let (first, second) = (error(0), error(1));
        means.add(&[first, first * first, first * second]);
    }
    let square = (whole[0] - input.target[0]).powi(2);
    means.holds(2, square, 1e-12, "the product");
    means.holds(1, square + means.variance(0), 1e-12, "the square");
    assert!(means.variance(0) > 1e-4, "{}", means.variance(0));
}
