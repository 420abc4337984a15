//! What is minimised over a ray: errors of colour and opacity with their weights, of the depth, the distortion
//! and the sparsity.
//!
//! ```text
//! loss = 1/(4M) Σ_x v_x e'_x e''_x  +  λ_t/M D²  +  λ_x/M X  +  λ_s/M S
//! e' = R' − g,  e'' = R'' − g
//! v_x  = 1                     squared, and always for the opacity
//! v_x  = 1 / (max(R_x, g_x/1000) max(R_x, g_x) + 0.01)     relative; a constant as far as gradients go
//! D    = Σ_i ω_i (t_i − g_t)
//! S    = Σ_i γ_i (1 − T_i) δ_i ln(1 + σ_i/σ_0)          γ = (g' + g'')/2
//! X    = Σ_ij ω_i ω_j |x_i − x_j| + 1/3 Σ_i ω_i² Δ_i       x = t/(1 + t),  Δ = δ/(1 + t)²
//! ```
//!
//! `R'` and `R''` are the two estimates of [`super::selection`], with gains `g'` and `g''`, and `ω = (g' + g'')/2 w`. Of a
//! whole ray, all gains are 1 and `e' e''` is `(R − g)²`. Gradients by log-density and colour:
//!
//! ```text
//! d_c_xi = v_x/(4M) (ω'_i e''_x + ω''_i e'_x)
//! d_s_i  = Σ_x v_x/(4M) (e''_x dR'_x/ds_i + e'_x dR''_x/ds_i)  +  2 λ_t/M D dD/ds_i  +  λ_x/M Σ_j dX/dω_j dω_j/ds_i
//!          +  λ_s/M γ_i (1 − T_i) δ_i σ_i/(σ_0 + σ_i)
//! dX/dω_j = 2 Σ_k ω_k |x_j − x_k| + 2/3 ω_j Δ_j
//! ```
//!
//! The relative error follows Mildenhall et al. 2022 (RawNeRF, eq. 4), whose weight is `1/(R_x + ε)²`. With that, a
//! pixel that the field does not show yet pulls with its brightness over the field's. Fields of linear light learn
//! logarithms of colours, so what counts is the slope by `ln R_x`, `R_x v_x (R_x − g_x)/(2M)`: with the weight above
//! it grows with the ratio of field and photo towards `±1/(2M)`, and never beyond, until `R_x g_x` falls below the 0.01.
//! A weight by the target's square would let the slope vanish like `R_x/g_x`: colours that have become dark would stay
//! so. A thousandth of the target's brightness keeps rays that meet nothing from outweighing all others in the sum.
//!
//! `D` is composited like a colour `t_i − g_t` over 0, so that the transparent part of a ray has no error, and its
//! derivative is that of a colour.
//!
//! `X` is the distortion of Barron et al. 2022 (Mip-NeRF 360, eq. 15), which pulls the weights of a ray together. Its
//! derivative is that of a colour `dX/dω_j` over 0, taken as a constant. Distances `t` and steps `δ` are in sides of the
//! inner cube, and `x` orders what lies far away in a finite range.
//!
//! `S` is a prior for empty space in the form of Hedman et al. 2021 (SNeRG) with the logarithm of the density where
//! they have that of its square. What is hidden by what lies in front of it need not be there, and costs samples; what is
//! seen is left alone, since any price for it moves surfaces without texture. `1 − T` is a constant as far as gradients
//! go.

use super::composite::{CompositeInput, CompositeOutput, composite, optical_depths, transmittances};
use super::selection::{EstimatedRay, thin};
use crate::config::Transmittance;

/// Added to the squared colour that an error is relative to.
pub const RELATIVE_FLOOR: f64 = 0.01;

/// Part of the target's brightness that a rendered colour is at least taken for.
pub const DARKEST: f64 = 1e-3;

/// `σ_0`: density above which more of it costs little, per side of the inner cube.
pub const SPARSE_DENSITY: f64 = 5.0;

/// How errors count.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Loss {
    /// Whether errors of the colour count relative to the colour.
    pub is_relative: bool,
    /// `λ_t`, the weight of the depth's squared error.
    pub depth: f64,
    /// `λ_x`, the weight of the distortion.
    pub distortion: f64,
    /// `λ_s`, the weight of the sparsity.
    pub sparsity: f64,
}

/// Where the samples of a ray lie, in sides of the inner cube.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Places<'a> {
    /// `t_i`, `[samples]`; empty where no term of the loss needs them.
    pub distances: &'a [f64],
    /// `g_t`, where something is known to be; 0 where nothing is.
    pub depth: f64,
}

impl Loss {
    /// `v_x` of colour and opacity.
    pub fn weights(&self, rendered: [f64; 4], target: [f64; 4]) -> [f64; 4] {
        let weight = |x: usize| match self.is_relative && x < 3 {
            true => {
                let (own, wanted) = (rendered[x], target[x]);
                1.0 / (own.max(DARKEST * wanted) * own.max(wanted) + RELATIVE_FLOOR)
            }
            false => 1.0,
        };
        std::array::from_fn(weight)
    }
}

/// Composites a ray. `gains` are those of the kept samples in both estimates, `[samples, 2]`; without them all samples
/// are kept. The loss terms are those of the colour and the opacity, with their weights; the weights of the samples are
/// their own.
pub fn composite_with(
    loss: Loss,
    convention: Transmittance,
    ray: &CompositeInput,
    places: Places,
    gains: &[[f64; 2]],
) -> CompositeOutput {
    let mut output = composite(convention, ray);
    let all = vec![[1.0; 2]; ray.s.len()];
    let gains = if gains.is_empty() { &all } else { gains };
    let of = |gain: fn(&[f64; 2]) -> f64| gains.iter().map(gain).collect::<Vec<f64>>();
    let estimates = [thin(convention, ray, &of(|g| g[0])), thin(convention, ray, &of(|g| g[1]))];
    add_errors(loss, ray, &estimates, &mut output);
    let thinned = Thinned { convention, ray, gains: of(|g| 0.5 * (g[0] + g[1])) };
    let m = f64::from(ray.rays_in_batch.max(1));
    if places.depth > 0.0 && loss.depth > 0.0 {
        let offsets: Vec<f64> = places.distances.iter().map(|t| t - places.depth).collect();
        let depth = thinned.weighted(&offsets).rendered[0];
        output.loss += loss.depth / m * depth * depth;
        thinned.add_slopes(2.0 * loss.depth / m * depth, &offsets, &mut output);
    }
    if loss.distortion > 0.0 {
        let weights = thinned.weighted(&vec![0.0; ray.s.len()]).weights;
        let (distortion, slopes) = distortion(&weights, places.distances, ray.delta);
        output.loss += loss.distortion / m * distortion;
        thinned.add_slopes(loss.distortion / m, &slopes, &mut output);
    }
    if loss.sparsity > 0.0 {
        let (sparsity, slopes) = sparsity(convention, ray, &thinned.gains);
        output.loss += loss.sparsity / m * sparsity;
        output.d_s.iter_mut().zip(slopes).for_each(|(d_s, slope)| *d_s += loss.sparsity / m * slope);
    }
    output
}

/// Replaces colour, loss and gradients by those of the two estimates.
fn add_errors(
    loss: Loss,
    ray: &CompositeInput,
    [first, second]: &[EstimatedRay; 2],
    output: &mut CompositeOutput,
) {
    let m = f64::from(ray.rays_in_batch.max(1));
    let error = |estimate: &EstimatedRay, x: usize| estimate.rendered[x] - ray.target[x];
    output.rendered = std::array::from_fn(|x| 0.5 * (first.rendered[x] + second.rendered[x]));
    let v = loss.weights(output.rendered, ray.target);
    output.loss_terms = std::array::from_fn(|x| v[x] * error(first, x) * error(second, x));
    output.loss = output.loss_terms.iter().sum::<f64>() / (4.0 * m);
    // The error of each estimate is a factor of the other's derivative.
    let d_first: [f64; 4] = std::array::from_fn(|x| v[x] * error(second, x) / (4.0 * m));
    let d_second: [f64; 4] = std::array::from_fn(|x| v[x] * error(first, x) / (4.0 * m));
    for i in 0..ray.s.len() {
        let by_color = |x: usize| d_first[x] * first.weights[i] + d_second[x] * second.weights[i];
        let by_s = |x: usize| d_first[x] * first.by_s[i][x] + d_second[x] * second.by_s[i][x];
        output.d_color[i] = std::array::from_fn(by_color);
        output.d_s[i] = (0..4).map(by_s).sum();
    }
}

/// A ray whose kept samples have the mean of their gains.
struct Thinned<'a> {
    convention: Transmittance,
    ray: &'a CompositeInput<'a>,
    gains: Vec<f64>,
}

impl Thinned<'_> {
    /// The ray with a value per sample as its red, over 0.
    fn weighted(&self, values: &[f64]) -> EstimatedRay {
        let color: Vec<_> = values.iter().map(|&value| [value, 0.0, 0.0]).collect();
        let channel = CompositeInput { color: &color, background: [0.0; 3], ..*self.ray };
        thin(self.convention, &channel, &self.gains)
    }

    /// Adds the gradient by log-density of `factor Σ_i ω_i values_i`.
    fn add_slopes(&self, factor: f64, values: &[f64], output: &mut CompositeOutput) {
        for (d_s, by_s) in output.d_s.iter_mut().zip(self.weighted(values).by_s) {
            *d_s += factor * by_s[0];
        }
    }
}

/// `X` of samples of these weights, distances and steps, and `dX/dω` of each of them.
pub fn distortion(weights: &[f64], distances: &[f64], delta: &[f64]) -> (f64, Vec<f64>) {
    let x: Vec<f64> = distances.iter().map(|t| t / (1.0 + t)).collect();
    let width: Vec<f64> = distances.iter().zip(delta).map(|(t, delta)| delta / (1.0 + t).powi(2)).collect();
    let apart = |i: usize| weights.iter().zip(&x).map(|(w, other)| w * (x[i] - other).abs()).sum::<f64>();
    let terms = (0..x.len()).map(|i| weights[i] * (apart(i) + weights[i] * width[i] / 3.0));
    let slopes = (0..x.len()).map(|i| 2.0 * apart(i) + 2.0 / 3.0 * weights[i] * width[i]);
    (terms.sum(), slopes.collect())
}

/// `S` of a ray whose samples have these mean gains, and its slopes by their log-densities.
pub fn sparsity(convention: Transmittance, ray: &CompositeInput, gains: &[f64]) -> (f64, Vec<f64>) {
    let in_front = transmittances(convention, &optical_depths(ray));
    let factor = |i: usize| gains[i] * (1.0 - in_front[i]) * ray.delta[i];
    let relative = |i: usize| ray.s[i].exp() / SPARSE_DENSITY;
    let terms = (0..ray.s.len()).map(|i| factor(i) * relative(i).ln_1p());
    let slopes = (0..ray.s.len()).map(|i| factor(i) * relative(i) / (1.0 + relative(i)));
    (terms.sum(), slopes.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const RAY: CompositeInput = CompositeInput {
        s: &[0.3, 1.2, -0.4],
        delta: &[0.5, 0.25, 1.0],
        color: &[[0.2, 3.0, 0.5], [0.9, 0.1, 7.0], [0.4, 0.4, 0.0]],
        target: [0.5, 2.0, 4.0, 1.0],
        background: [0.1, 0.2, 0.3],
        rays_in_batch: 3,
    };

    #[test]
    fn plainly_it_is_what_compositing_says() {
        for convention in [Transmittance::Exclusive, Transmittance::Inclusive] {
            assert_eq!(
                composite_with(Loss::default(), convention, &RAY, Places::default(), &[]),
                composite(convention, &RAY)
            );
        }
    }

    /// The loss with the weights that the undisturbed ray has.
    fn loss_at(loss: Loss, weights: [f64; 4], convention: Transmittance, ray: &CompositeInput) -> f64 {
        let plain = composite(convention, ray);
        let m = f64::from(ray.rays_in_batch);
        let terms = (0..4).map(|x| weights[x] * (plain.rendered[x] - ray.target[x]).powi(2));
        let w = &plain.weights;
        let depth: f64 = w.iter().zip(PLACES.distances).map(|(w, t)| w * (t - PLACES.depth)).sum();
        // x of the distances is 1/4, 1/2 and 3/5.
        let distortion = 2.0 * (w[0] * w[1] * 0.25 + w[0] * w[2] * 0.35 + w[1] * w[2] * 0.1)
            + (w[0] * w[0] * 0.5 * 0.5625 + w[1] * w[1] * 0.25 * 0.25 + w[2] * w[2] * 0.16) / 3.0;
        terms.sum::<f64>() / (4.0 * m) + (loss.depth * depth * depth + loss.distortion * distortion) / m
    }

    const PLACES: Places = Places { distances: &[1.0 / 3.0, 1.0, 1.5], depth: 0.7 };

    #[test]
    fn gradients_are_slopes() {
        let loss = Loss { is_relative: true, depth: 0.7, distortion: 0.4, sparsity: 0.0 };
        for convention in [Transmittance::Exclusive, Transmittance::Inclusive] {
            let output = composite_with(loss, convention, &RAY, PLACES, &[]);
            let weights = loss.weights(output.rendered, RAY.target);
            assert!((output.loss - loss_at(loss, weights, convention, &RAY)).abs() < 1e-12);
            for i in 0..3 {
                let at = |h: f64| {
                    let mut s = RAY.s.to_vec();
                    s[i] += h;
                    loss_at(loss, weights, convention, &CompositeInput { s: &s, ..RAY })
                };
                let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
                assert!((slope - output.d_s[i]).abs() < 1e-9, "{slope} {}", output.d_s[i]);
                for x in 0..3 {
                    let at = |h: f64| {
                        let mut color = RAY.color.to_vec();
                        color[i][x] += h;
                        loss_at(loss, weights, convention, &CompositeInput { color: &color, ..RAY })
                    };
                    let slope = (at(1e-5) - at(-1e-5)) / 2e-5;
                    assert!((slope - output.d_color[i][x]).abs() < 1e-9, "{slope}");
                }
            }
        }
    }

    /// By the logarithm of the colour, whatever the photo's: at most 1, and hardly less for what is far too dark.
    #[test]
    fn relative_errors_pull_alike() {
        let loss = Loss { is_relative: true, ..Loss::default() };
        let pull = |rendered: f64, target: f64| {
            let weight = loss.weights([rendered; 4], [target; 4])[0];
            rendered * weight * (rendered - target)
        };
        for rendered in [1e-4, 0.01, 0.3, 1.0, 20.0, 1e4] {
            for target in [0.0, 0.01, 0.5, 3.0, 1e3] {
                assert!(pull(rendered, target).abs() <= 1.0, "{rendered} {target}");
            }
        }
        assert!(pull(0.1, 10.0) < -0.95 && pull(0.01, 10.0) < -0.9 && pull(10.0, 0.1) > 0.95);
    }

    /// One opaque sample at a distance of 0.2 behind the goal: D = 0.2; what is transparent has no error.
    #[test]
    fn only_what_is_there_has_a_depth() {
        let loss = Loss { depth: 2.0, ..Loss::default() };
        let places = Places { distances: &[0.9], depth: 0.7 };
        let ray = |s: &'static [f64]| CompositeInput {
            s,
            delta: &[1.0],
            color: &[[1.0; 3]],
            target: [1.0; 4],
            background: [1.0; 3],
            rays_in_batch: 1,
        };
        let of = |s| composite_with(loss, Transmittance::Exclusive, &ray(s), places, &[]);
        assert!((of(&[10.0]).loss - 2.0 * 0.04).abs() < 1e-12);
        assert!((of(&[-50.0]).loss - 0.25).abs() < 1e-12);
    }

    /// Its gradient is the slope of the sum in which the transmittances are those of the undisturbed ray.
    #[test]
    fn sparsity_is_a_sum_over_densities() {
        let loss = Loss { sparsity: 0.6, ..Loss::default() };
        let gains = [[2.0, 0.0], [0.0, 5.0], [1.0, 1.0]];
        for convention in [Transmittance::Exclusive, Transmittance::Inclusive] {
            let with = composite_with(loss, convention, &RAY, PLACES, &gains);
            let without = composite_with(Loss::default(), convention, &RAY, PLACES, &gains);
            let constants = transmittances(convention, &optical_depths(&RAY));
            let part = |i: usize, s: f64| {
                let gain = [1.0, 2.5, 1.0][i];
                0.6 / 3.0 * gain * (1.0 - constants[i]) * RAY.delta[i] * (1.0 + s.exp() / 5.0).ln()
            };
            let sum: f64 = (0..3).map(|i| part(i, RAY.s[i])).sum();
            assert!((with.loss - without.loss - sum).abs() < 1e-12);
            for (i, s) in RAY.s.iter().enumerate() {
                let slope = (part(i, s + 1e-5) - part(i, s - 1e-5)) / 2e-5;
                assert!((with.d_s[i] - without.d_s[i] - slope).abs() < 1e-9, "{slope}");
            }
        }
    }

    /// Two halves at x = 1/2 and 3/4, and one alone.
    #[test]
    fn distortion_by_hand() {
        let (apart, slopes) = distortion(&[0.5; 2], &[1.0, 3.0], &[0.0, 1.6]);
        assert!((apart - (2.0 * 0.25 * 0.25 + 0.25 * 0.1 / 3.0)).abs() < 1e-15, "{apart}");
        assert!((slopes[0] - 0.25).abs() < 1e-15 && (slopes[1] - 0.25 - 0.1 / 3.0).abs() < 1e-15);
        assert_eq!(distortion(&[1.0], &[2.0], &[0.0]), (0.0, vec![0.0]));
        assert_eq!(distortion(&[], &[], &[]), (0.0, vec![]));
    }
}
