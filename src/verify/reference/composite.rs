//! Compositing of one ray, its loss, and the gradient of the loss: the specification of the fused kernel.
//!
//! With log-densities `s_i`, steps `δ_i`, colours `c_i`, background `b`, target `g` and `M` rays in the batch
//! (forward: Mildenhall et al. 2020, eq. 3; gradient by log-density: after Perlman 2023):
//!
//! ```text
//! τ_i = exp(s_i) δ_i      α_i = 1 − exp(−τ_i)      w_i = T_i α_i
//! T_i = exp(−Σ_{j<i} τ_j) exclusive,  exp(−Σ_{j≤i} τ_j) inclusive;  T_{N+1} = exp(−Σ_all τ_j)
//! R_x = Σ_i w_i c_xi + T_{N+1} b_x        for opacity c = 1 and b = 0
//! loss = 1/(4M) Σ_x (R_x − g_x)²
//! d_c_xi = (R_x − g_x)/(2M) w_i           d_s_i = Σ_x (R_x − g_x)/(2M) dR_x/ds_i
//! ```
//!
//! The derivative walks the ray backwards once. `B_i`, the colour seen from just behind sample `i`, replaces
//! the sums over all later samples, so nothing is the difference of two large numbers:
//!
//! ```text
//! exclusive:  B_N = b,  dR/ds_i = τ_i e^{−τ_i} T_i (c_i − B_i),      B_{i−1} = α_i c_i + e^{−τ_i} B_i
//! inclusive:  B_N = b,  dR/ds_i = τ_i T_i [(1 − 2α_i) c_i − B_i],    B_{i−1} = e^{−τ_i} (α_i c_i + B_i)
//! ```

use crate::config::Transmittance;

/// Opacity below which a ray has no depth.
pub const MIN_DEPTH_OPACITY: f64 = 1e-3;

/// Beyond this optical depth `e^{−τ}` is 0 even in f64 (from 746 on), and so is every product with `τ` in this
/// module: the clamp changes no result, and `τ` cannot become infinite.
const MAX_OPTICAL_DEPTH: f64 = 1000.0;

/// One ray and what it should look like. The slices have one element per sample, front to back.
#[derive(Clone, Copy, Debug)]
pub struct CompositeInput<'a> {
    /// Log-densities `[samples]`; densities are per unit of `delta`.
    pub s: &'a [f64],
    /// Step lengths `[samples]`.
    pub delta: &'a [f64],
    /// Colours `[samples, 3]`.
    pub color: &'a [[f64; 3]],
    /// Target colour (premultiplied, over the background) and opacity.
    pub target: [f64; 4],
    /// Colour behind the last sample.
    pub background: [f64; 3],
    /// `M`: rays in the batch, those without samples included.
    pub rays_in_batch: u32,
}

/// What compositing makes of a ray.
#[derive(Clone, Debug, PartialEq)]
pub struct CompositeOutput {
    /// `R`: colour over the background, and opacity.
    pub rendered: [f64; 4],
    /// `(R_x − g_x)²`, not divided by anything.
    pub loss_terms: [f64; 4],
    /// This ray's share of the batch's loss: the sum of the terms over `4M`.
    pub loss: f64,
    /// `w_i = T_i α_i`, `[samples]`.
    pub weights: Vec<f64>,
    /// Transmittance behind the last sample.
    pub transmittance_end: f64,
    /// ∂loss/∂color, `[samples, 3]`.
    pub d_color: Vec<[f64; 3]>,
    /// ∂loss/∂s, `[samples]`.
    pub d_s: Vec<f64>,
}

/// Optical depth `τ = exp(s) δ` of a sample, as `exp(s + ln δ)`; 0 where `δ` is not positive.
pub fn optical_depth(s: f64, delta: f64) -> f64 {
    let log_depth = s + delta.ln();
    if delta > 0.0 && !log_depth.is_nan() { log_depth.min(MAX_OPTICAL_DEPTH.ln()).exp() } else { 0.0 }
}

/// Opacity `α = 1 − exp(−τ)` of a sample, accurate for small depths too.
pub fn opacity(depth: f64) -> f64 {
    -(-depth).exp_m1()
}

/// Composites a ray, and gives its loss and gradients. See the module for the formulas.
pub fn composite(convention: Transmittance, ray: &CompositeInput) -> CompositeOutput {
    let depths = optical_depths(ray);
    let transmittances = transmittances(convention, &depths);
    let transmittance_end = (-depths.iter().sum::<f64>()).exp();
    let weights: Vec<f64> =
        (transmittances.iter().zip(&depths)).map(|(t, &depth)| t * opacity(depth)).collect();

    let mut rendered = with_opacity(ray.background, 0.0).map(|b| transmittance_end * b);
    for (&w, &color) in weights.iter().zip(ray.color) {
        let color = with_opacity(color, 1.0);
        for x in 0..4 {
            rendered[x] += w * color[x];
        }
    }

    let m = f64::from(ray.rays_in_batch.max(1));
    let residual: [f64; 4] = std::array::from_fn(|x| rendered[x] - ray.target[x]);
    let loss_terms = residual.map(|r| r * r);
    let d_rendered = residual.map(|r| r / (2.0 * m));
    let by_s = d_rendered_by_s(convention, ray);
    CompositeOutput {
        rendered,
        loss_terms,
        loss: loss_terms.iter().sum::<f64>() / (4.0 * m),
        d_color: (weights.iter()).map(|w| std::array::from_fn(|x| d_rendered[x] * w)).collect(),
        d_s: (by_s.iter()).map(|by_s| (0..4).map(|x| d_rendered[x] * by_s[x]).sum()).collect(),
        weights,
        transmittance_end,
    }
}

/// dR/ds of every sample, `[samples, 4]`, by one walk from back to front.
pub fn d_rendered_by_s(convention: Transmittance, ray: &CompositeInput) -> Vec<[f64; 4]> {
    let depths = optical_depths(ray);
    let transmittances = transmittances(convention, &depths);
    let mut behind = with_opacity(ray.background, 0.0);
    let mut derivatives = vec![[0.0; 4]; depths.len()];
    for i in (0..depths.len()).rev() {
        let (depth, t) = (depths[i], transmittances[i]);
        let (alpha, through) = (opacity(depth), (-depth).exp());
        let color = with_opacity(ray.color[i], 1.0);
        for x in 0..4 {
            let (c, b) = (color[x], behind[x]);
            (derivatives[i][x], behind[x]) = match convention {
                Transmittance::Exclusive => (depth * through * t * (c - b), alpha * c + through * b),
                Transmittance::Inclusive => {
                    (depth * t * ((1.0 - 2.0 * alpha) * c - b), through * (alpha * c + b))
                }
            };
        }
    }
    derivatives
}

/// `τ_i` of every sample.
pub fn optical_depths(ray: &CompositeInput) -> Vec<f64> {
    (ray.s.iter().zip(ray.delta)).map(|(&s, &delta)| optical_depth(s, delta)).collect()
}

/// `T_i` of every sample, from the optical depths.
pub fn transmittances(convention: Transmittance, depths: &[f64]) -> Vec<f64> {
    let mut before = 0.0;
    (depths.iter())
        .map(|&depth| {
            let after = before + depth;
            let sum = match convention {
                Transmittance::Exclusive => before,
                Transmittance::Inclusive => after,
            };
            before = after;
            (-sum).exp()
        })
        .collect()
}

/// Mean distance `Σ w z / Σ w` of a ray; 0 where its opacity `Σ w` is below [`MIN_DEPTH_OPACITY`].
///
/// `z` has one distance per sample, in whatever unit the result shall have.
pub fn mean_depth(weights: &[f64], z: &[f64]) -> f64 {
    let opacity: f64 = weights.iter().sum();
    if opacity < MIN_DEPTH_OPACITY {
        return 0.0;
    }
    weights.iter().zip(z).map(|(w, z)| w * z).sum::<f64>() / opacity
}

/// The four channels of a colour: its own and `opacity`.
pub(super) fn with_opacity(color: [f64; 3], opacity: f64) -> [f64; 4] {
    [color[0], color[1], color[2], opacity]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uniform_slab(convention: Transmittance, samples: usize, total_depth: f64) -> CompositeOutput {
        let s = vec![total_depth.ln(); samples];
        composite(
            convention,
            &CompositeInput {
                s: &s,
                delta: &vec![1.0 / samples as f64; samples],
                color: &vec![[1.0; 3]; samples],
                target: [0.0; 4],
                background: [0.0; 3],
                rays_in_batch: 1,
            },
        )
    }

    /// A slab of optical depth 50 in 8 samples: `1 − e^{−50}`, against `e^{−50/8} (1 − e^{−50})`.
    #[test]
    fn inclusive_slab_is_nearly_transparent() {
        let exclusive = uniform_slab(Transmittance::Exclusive, 8, 50.0).rendered[3];
        let inclusive = uniform_slab(Transmittance::Inclusive, 8, 50.0).rendered[3];
        assert!((exclusive - 1.0).abs() < 1e-12);
        assert!((inclusive - (-6.25_f64).exp()).abs() < 1e-12);
        assert!((inclusive - 0.0019).abs() < 5e-5);
    }

    /// Inclusive, one sample: `w = e^{−τ} (1 − e^{−τ})`, at most 1/4 (at `τ = ln 2`) and 0 when opaque.
    #[test]
    fn inclusive_weight_is_a_quarter_at_most() {
        let weight = |depth| uniform_slab(Transmittance::Inclusive, 1, depth).weights[0];
        assert!((weight(2.0_f64.ln()) - 0.25).abs() < 1e-15);
        assert!(weight(0.5) < 0.25 && weight(1.0) < 0.25);
        assert!(weight(1e6) == 0.0);
    }

    #[test]
    fn depth_is_the_weighted_mean() {
        assert_eq!(mean_depth(&[0.25, 0.75], &[1.0, 2.0]), 1.75);
        assert_eq!(mean_depth(&[5e-4], &[3.0]), 0.0);
        assert_eq!(mean_depth(&[], &[]), 0.0);
    }

    #[test]
    fn extremes_follow_their_limits() {
        assert_eq!(optical_depth(1e30, 0.0), 0.0);
        assert_eq!(optical_depth(-1e30, 1e30), 0.0);
        assert_eq!(opacity(optical_depth(1e30, 1e-30)), 1.0);
        assert!((opacity(1e-20) - 1e-20).abs() < 1e-35);
        assert_eq!(optical_depth(f64::NEG_INFINITY, f64::INFINITY), 0.0);
    }

    #[test]
    fn extreme_rays_stay_finite() {
        let s = [1e30, -1e30, 109.0, 0.0, 1e3, -1e3];
        let color = [[1e5; 3]; 6];
        for convention in [Transmittance::Exclusive, Transmittance::Inclusive] {
            for delta in [[0.0; 6], [1e-38; 6], [1e30; 6]] {
                for samples in 0..=6 {
                    let output = composite(
                        convention,
                        &CompositeInput {
                            s: &s[..samples],
                            delta: &delta[..samples],
                            color: &color[..samples],
                            target: [1e5, 0.0, 0.0, 1.0],
                            background: [1.0; 3],
                            rays_in_batch: 0,
                        },
                    );
                    let values = output.d_s.iter().chain(output.d_color.as_flattened());
                    assert!(values.chain(&output.weights).chain(&output.rendered).all(|v| v.is_finite()));
                    assert!(output.loss.is_finite());
                }
            }
        }
    }
}
