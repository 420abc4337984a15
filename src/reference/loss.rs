//! What is minimised over a ray: errors of colour and opacity with their weights, and of the depth.
//!
//! ```text
//! loss = 1/(4M) Σ_x v_x (R_x − g_x)²  +  λ/M D²        D = Σ_i w_i (t_i − g_t)
//! v_x = 1                     squared, and always for the opacity
//! v_x = 1 / (max(R_x, g_x/1000) max(R_x, g_x) + 0.01)     relative; a constant as far as gradients go
//! d_c_xi = v_x (R_x − g_x)/(2M) w_i
//! d_s_i  = Σ_x v_x (R_x − g_x)/(2M) dR_x/ds_i  +  2λ/M D dD/ds_i
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

use super::Transmittance;
use super::composite::{CompositeInput, CompositeOutput, composite};
use super::selection::thin;

/// Added to the squared colour that an error is relative to.
pub const RELATIVE_FLOOR: f64 = 0.01;

/// Part of the target's brightness that a rendered colour is at least taken for.
pub const DARKEST: f64 = 1e-3;

/// How errors count.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Loss {
    /// Whether errors of the colour count relative to the colour.
    pub is_relative: bool,
    /// `λ`, the weight of the depth's squared error.
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

/// Composites a ray whose samples lie `offsets` behind the known depth, `t_i − g_t`; without offsets the depth is
/// not known. `gains` are those of [`thin`]; without them all samples are kept. The loss terms are those of the colour
/// and the opacity, with their weights.
pub fn composite_with(
    loss: Loss,
    convention: Transmittance,
    ray: &CompositeInput,
    offsets: &[f64],
    gains: &[f64],
) -> CompositeOutput {
    let mut output = composite(convention, ray);
    let all = vec![1.0; ray.s.len()];
    let gains = if gains.is_empty() { &all } else { gains };
    let thinned = thin(convention, ray, gains);
    (output.rendered, output.weights) = (thinned.rendered, thinned.weights);
    let m = f64::from(ray.rays_in_batch.max(1));
    let weights = loss.weights(output.rendered, ray.target);
    let residual: [f64; 4] = std::array::from_fn(|x| output.rendered[x] - ray.target[x]);
    output.loss_terms = std::array::from_fn(|x| weights[x] * residual[x] * residual[x]);
    output.loss = output.loss_terms.iter().sum::<f64>() / (4.0 * m);
    let d_rendered: [f64; 4] = std::array::from_fn(|x| weights[x] * residual[x] / (2.0 * m));
    let w = &output.weights;
    output.d_color = w.iter().map(|w| std::array::from_fn(|x| d_rendered[x] * w)).collect();
    let by_s = thinned.by_s.iter();
    output.d_s = by_s.map(|by_s| (0..4).map(|x| d_rendered[x] * by_s[x]).sum()).collect();
    if !offsets.is_empty() {
        add_depth(loss.depth / m, convention, ray, (offsets, gains), &mut output);
    }
    output
}

/// Adds what the depth has of the loss and of the gradient by log-density; `share` is `λ/M`.
fn add_depth(
    share: f64,
    convention: Transmittance,
    ray: &CompositeInput,
    (offsets, gains): (&[f64], &[f64]),
    output: &mut CompositeOutput,
) {
    let depth: f64 = output.weights.iter().zip(offsets).map(|(w, offset)| w * offset).sum();
    output.loss += share * depth * depth;
    let color: Vec<_> = offsets.iter().map(|&offset| [offset, 0.0, 0.0]).collect();
    let channel = CompositeInput { color: &color, background: [0.0; 3], ..*ray };
    for (d_s, by_s) in output.d_s.iter_mut().zip(thin(convention, &channel, gains).by_s) {
        *d_s += 2.0 * share * depth * by_s[0];
    }
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
                composite_with(Loss::default(), convention, &RAY, &[], &[]),
                composite(convention, &RAY)
            );
        }
    }

    /// The loss with the weights that the undisturbed ray has.
    fn loss_at(loss: Loss, weights: [f64; 4], convention: Transmittance, ray: &CompositeInput) -> f64 {
        let plain = composite(convention, ray);
        let m = f64::from(ray.rays_in_batch);
        let terms = (0..4).map(|x| weights[x] * (plain.rendered[x] - ray.target[x]).powi(2));
        let depth: f64 = plain.weights.iter().zip(OFFSETS).map(|(w, offset)| w * offset).sum();
        terms.sum::<f64>() / (4.0 * m) + loss.depth / m * depth * depth
    }

    const OFFSETS: [f64; 3] = [-0.3, 0.1, 0.8];

    #[test]
    fn gradients_are_slopes() {
        let loss = Loss { is_relative: true, depth: 0.7 };
        for convention in [Transmittance::Exclusive, Transmittance::Inclusive] {
            let output = composite_with(loss, convention, &RAY, &OFFSETS, &[]);
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
        let loss = Loss { is_relative: true, depth: 0.0 };
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
        let loss = Loss { is_relative: false, depth: 2.0 };
        let ray = |s: &'static [f64]| CompositeInput {
            s,
            delta: &[1.0],
            color: &[[1.0; 3]],
            target: [1.0; 4],
            background: [1.0; 3],
            rays_in_batch: 1,
        };
        let of = |s| composite_with(loss, Transmittance::Exclusive, &ray(s), &[0.2], &[]);
        assert!((of(&[10.0]).loss - 2.0 * 0.04).abs() < 1e-12);
        assert!((of(&[-50.0]).loss - 0.25).abs() < 1e-12);
    }
}
