//! Which marched samples of a ray go on to the colour network and the backward pass, and what they stand for.
//!
//! Walking front to back with the exclusive transmittance `T`, the ray ends where `T < stop_transmittance`. Samples of
//! weight `w = T α ≥ floor` are *heavy* and kept. The light ones between two heavy ones form groups that end where
//! their weight `W` reaches the floor. One member of a group stands for all, drawn by weight: its colour then has the
//! weight `ω = W`, and `Σ_k ω_k c_k` over the kept samples has the mean `Σ_i w_i c_i` over all samples. A group with
//! `W < θ = light_share · floor` is kept with probability `W/θ` and then has the weight `θ`; the next kept sample takes
//! over the difference, `W` or `W − θ`, whose mean is 0.
//!
//! Densities are known of all samples, so transmittance and opacity are exact. What is left is the colour, and its
//! variance is at most the floor times that of the colours within a group. With `T_e` behind the last sample and
//! `g_k = ω_k / w_k`, the *gain*, a ray of kept samples `k` has
//!
//! ```text
//! R      = Σ_k ω_k c_k + T_e b
//! d_c_k  = (R − g)/(2M) ω_k
//! d_s_k  = g_k τ_k Σ_x (R_x − g_x)/(2M) [ Σ_{m>k} ω_m (c_k − c_m) + T_e (c_k − b) ]
//! ```
//!
//! The bracket is `T_{k+1} (c_k − B_k)` where what was left out behind `k` in its own group has its colour; for the
//! opacity it is `T_e`, exactly. The gain makes the sum over the kept samples that over all.

use super::composite::{CompositeInput, opacity, optical_depth, optical_depths, transmittances};
use super::{Transmittance, composite};

/// When a sample is worth keeping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection {
    /// Transmittance below which a ray ends.
    pub stop_transmittance: f64,
    /// Weight from which on a sample is heavy; 0 keeps all.
    pub floor: f64,
    /// `θ/floor`, above 0.
    pub light_share: f64,
}

impl Default for Selection {
    fn default() -> Self {
        Self { stop_transmittance: 1e-4, floor: 5e-3, light_share: 0.125 }
    }
}

/// The random numbers of a sample, in `[0, 1)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Luck {
    /// Whether it takes over its group.
    pub member: f64,
    /// Whether its group is kept, if it stands for a very light one.
    pub light: f64,
}

/// A sample that is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kept {
    /// Which of the marched samples.
    pub index: usize,
    /// `ω/w`: how many times its own weight its colour has.
    pub gain: f64,
}

/// What a ray's walk has found so far.
#[derive(Clone, Debug, Default)]
struct Walk {
    kept: Vec<Kept>,
    /// Weight that the next kept sample makes up for.
    carry: f64,
    /// The open group: its weight, and the index and weight of the member that stands for it.
    light: f64,
    member: (usize, f64),
}

/// The kept samples of a ray, in order, and how many samples it has up to its end.
///
/// `s` and `delta` have one element per marched sample.
pub fn select(
    selection: &Selection,
    s: &[f64],
    delta: &[f64],
    luck: impl Fn(usize) -> Luck,
) -> (Vec<Kept>, usize) {
    let mut walk = Walk::default();
    let mut depth_before = 0.0_f64;
    let mut reached = 0;
    for (index, (&s, &delta)) in s.iter().zip(delta).enumerate() {
        let transmittance = (-depth_before).exp();
        if transmittance < selection.stop_transmittance {
            break;
        }
        reached = index + 1;
        let depth = optical_depth(s, delta);
        let weight = transmittance * opacity(depth);
        if weight >= selection.floor {
            walk.close(selection, &luck);
            let gain = 1.0 + walk.carry / weight.max(f64::MIN_POSITIVE);
            walk.kept.push(Kept { index, gain });
            walk.carry = 0.0;
        } else {
            walk.light += weight;
            if luck(index).member * walk.light < weight {
                walk.member = (index, weight);
            }
            if walk.light >= selection.floor {
                walk.close(selection, &luck);
            }
        }
        depth_before += depth;
    }
    walk.close(selection, &luck);
    (walk.kept, reached)
}

impl Walk {
    fn close(&mut self, selection: &Selection, luck: &impl Fn(usize) -> Luck) {
        let light = std::mem::take(&mut self.light);
        if light == 0.0 {
            return;
        }
        let probability = (light / (selection.light_share * selection.floor)).min(1.0);
        let (index, weight) = self.member;
        if luck(index).light < probability {
            let stood_for = light / probability;
            self.kept.push(Kept { index, gain: (stood_for + self.carry) / weight });
            self.carry = light - stood_for;
        } else {
            self.carry += light;
        }
    }
}

/// A ray of which some samples are kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Thinned {
    /// `R`: colour over the background, and opacity.
    pub rendered: [f64; 4],
    /// `ω` of every sample, 0 where it is left out.
    pub weights: Vec<f64>,
    /// `g dR/ds` of every sample, `[samples, 4]`.
    pub by_s: Vec<[f64; 4]>,
}

/// Composites a ray of whose samples those with a gain above 0 are kept; the others only absorb. With a gain of 1
/// everywhere it is the whole ray, and only that is known in the inclusive convention.
pub fn thin(convention: Transmittance, ray: &CompositeInput, gains: &[f64]) -> Thinned {
    let depths = optical_depths(ray);
    let transmittance_end = (-depths.iter().sum::<f64>()).exp();
    let weights: Vec<f64> = (transmittances(convention, &depths).iter().zip(&depths))
        .zip(gains)
        .map(|((t, &depth), gain)| gain * t * opacity(depth))
        .collect();
    let color = |i: usize| composite::with_opacity(ray.color[i], 1.0);
    let background = composite::with_opacity(ray.background, 0.0);
    let channel = |x: usize| {
        let kept = (0..weights.len()).map(|i| weights[i] * color(i)[x]);
        kept.sum::<f64>() + transmittance_end * background[x]
    };
    let rendered = std::array::from_fn(channel);
    if gains.iter().all(|&gain| gain == 1.0) {
        return Thinned { rendered, weights, by_s: composite::d_rendered_by_s(convention, ray) };
    }
    let derivative = |k: usize, x: usize| {
        let own = color(k)[x];
        let behind: f64 = (k + 1..weights.len()).map(|m| weights[m] * (own - color(m)[x])).sum();
        gains[k] * depths[k] * (behind + transmittance_end * (own - background[x]))
    };
    let by_s = (0..weights.len()).map(|k| std::array::from_fn(|x| derivative(k, x))).collect();
    Thinned { rendered, weights, by_s }
}

#[cfg(test)]
mod tests;
