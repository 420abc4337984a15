//! Which marched samples of a ray go on to the colour network and the backward pass, and what they stand for.
//!
//! Walking front to back with the exclusive transmittance `T`, the ray ends where `T < stop_transmittance`. Samples of
//! weight `w = T α ≥ floor` are *heavy* and kept. The light ones between two heavy ones form groups that end where
//! their weight `W` reaches `2 floor`, so that `W < 3 floor`.
//!
//! # Two estimates
//!
//! The kept samples hold two estimates of the ray's colour, `R'` and `R''`, which share the heavy samples and the
//! groups, but no random number. In either, one member of a group stands for all of it, drawn by weight: its colour then
//! has the weight `ω = W`, and `Σ_k ω_k c_k` over the kept samples has the mean `Σ_i w_i c_i` over all samples. A group
//! with `W < θ = light_share · floor` is kept with probability `W/θ` and then has the weight `θ`; the estimate's next
//! kept sample takes over the difference, `W` or `W − θ`, whose mean is 0 (Russian roulette, Arvo & Kirk 1990).
//!
//! Densities are known of all samples, so transmittance and opacity are exact. What is left is the colour, and the
//! variance of an estimate is at most `3 floor` times that of the colours within a group. With `T_e` behind the last
//! sample, the *gains* `g'_k = ω'_k / w_k` and `g''_k`, 0 where `k` is not in the estimate, and `v_x` from the mean:
//!
//! ```text
//! R'     = Σ_k ω'_k c_k + T_e b                   e'  = R' − g          R'' and e'' likewise;  R = (R' + R'')/2
//! loss   = 1/(4M) Σ_x v_x e'_x e''_x
//! d_c_k  = v/(4M) (ω'_k e'' + ω''_k e')
//! d_s_k  = τ_k Σ_x v_x/(4M) [ g'_k e''_x C'_kx + g''_k e'_x C''_kx ]
//! C'_k   = Σ_{m>k} ω'_m (c_k − c_m) + T_e (c_k − b)
//! ```
//!
//! As `R'` and `R''` are independent, the mean of the product is the square of the mean error, and so are the loss and
//! its gradient by the colours those of the whole ray. The mean of `(R' − g)²` would be more by the variance of `R'`,
//! which vanishes where nothing is light: its gradient makes rays opaque too early. `C'_k` is `T_{k+1} (c_k − B_k)`
//! where what was left out behind `k` in its own group has the colour of `k`; for the opacity it is `T_e`, exactly but
//! for the roulette. The gain makes the sum over the kept samples that over all.
//!
//! Of a ray whose gains are all 1, `R' = R''`, and this is [`super::composite`].

use super::composite;
use super::composite::{CompositeInput, opacity, optical_depth, optical_depths, transmittances};
use crate::config::Transmittance;

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

/// The random numbers of a sample, in `[0, 1)`, one for each estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Luck {
    /// Whether it takes over its group.
    pub member: [f64; 2],
    /// Whether its group is kept, if it stands for a very light one.
    pub light: [f64; 2],
}

/// A sample that is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kept {
    /// Which of the marched samples.
    pub index: usize,
    /// `ω/w` in both estimates: how many times its own weight its colour has; 0 where it is not in the estimate.
    pub gains: [f64; 2],
}

/// What a ray's walk has found so far.
#[derive(Clone, Debug, Default)]
struct Walk {
    kept: Vec<Kept>,
    /// Weights that the estimates' next kept samples make up for.
    carry: [f64; 2],
    /// Weight of the open group.
    light: f64,
    /// Index and weight of the members that stand for it.
    members: [(usize, f64); 2],
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
            let gains = walk.carry.map(|carry| 1.0 + carry / weight.max(f64::MIN_POSITIVE));
            walk.kept.push(Kept { index, gains });
            walk.carry = [0.0; 2];
        } else {
            walk.join(index, weight, luck(index));
            if walk.light >= 2.0 * selection.floor {
                walk.close(selection, &luck);
            }
        }
        depth_before += depth;
    }
    walk.close(selection, &luck);
    (walk.kept, reached)
}

impl Walk {
    /// A light sample joins the open group.
    fn join(&mut self, index: usize, weight: f64, luck: Luck) {
        self.light += weight;
        for (member, luck) in self.members.iter_mut().zip(luck.member) {
            if luck * self.light < weight {
                *member = (index, weight);
            }
        }
    }

    /// Ends the open group.
    fn close(&mut self, selection: &Selection, luck: &impl Fn(usize) -> Luck) {
        let light = std::mem::take(&mut self.light);
        if light == 0.0 {
            return;
        }
        let probability = (light / (selection.light_share * selection.floor)).min(1.0);
        let stood_for = light / probability;
        for estimate in 0..2 {
            let (index, weight) = self.members[estimate];
            if luck(index).light[estimate] < probability {
                self.keep(index, estimate, (stood_for + self.carry[estimate]) / weight);
                self.carry[estimate] = light - stood_for;
            } else {
                self.carry[estimate] += light;
            }
        }
    }

    /// Keeps a sample for one of the estimates.
    fn keep(&mut self, index: usize, estimate: usize, gain: f64) {
        let place = self.kept.partition_point(|kept| kept.index < index);
        if self.kept.get(place).is_none_or(|kept| kept.index != index) {
            self.kept.insert(place, Kept { index, gains: [0.0; 2] });
        }
        self.kept[place].gains[estimate] = gain;
    }
}

/// One estimate of a ray.
#[derive(Clone, Debug, PartialEq)]
pub struct EstimatedRay {
    /// `R'`: colour over the background, and opacity.
    pub rendered: [f64; 4],
    /// `ω'` of every sample, 0 where it is left out.
    pub weights: Vec<f64>,
    /// `g' τ C'` of every sample, which stands for dR/ds, `[samples, 4]`.
    pub by_s: Vec<[f64; 4]>,
}

/// Composites a ray of whose samples those with a gain other than 0 are kept; the others only absorb. With a gain of 1
/// everywhere it is the whole ray, and only that is known in the inclusive convention.
pub fn thin(convention: Transmittance, ray: &CompositeInput, gains: &[f64]) -> EstimatedRay {
    let depths = optical_depths(ray);
    let transmittance_end = (-depths.iter().sum::<f64>()).exp();
    let weights: Vec<f64> = (transmittances(convention, &depths).iter().zip(&depths))
        .zip(gains)
        .map(|((t, &depth), gain)| gain * t * opacity(depth))
        .collect();
    let kept: Vec<usize> = (0..weights.len()).filter(|&i| gains[i] != 0.0).collect();
    let color = |i: usize| composite::with_opacity(ray.color[i], 1.0);
    let background = composite::with_opacity(ray.background, 0.0);
    let channel = |x: usize| {
        kept.iter().fold(transmittance_end * background[x], |sum, &i| sum + weights[i] * color(i)[x])
    };
    let rendered = std::array::from_fn(channel);
    if gains.iter().all(|&gain| gain == 1.0) {
        return EstimatedRay { rendered, weights, by_s: composite::d_rendered_by_s(convention, ray) };
    }
    let mut by_s = vec![[0.0; 4]; weights.len()];
    for (place, &k) in kept.iter().enumerate() {
        by_s[k] = std::array::from_fn(|x| {
            let own = color(k)[x];
            let behind: f64 = kept[place + 1..].iter().map(|&m| weights[m] * (own - color(m)[x])).sum();
            gains[k] * depths[k] * (behind + transmittance_end * (own - background[x]))
        });
    }
    EstimatedRay { rendered, weights, by_s }
}

#[cfg(test)]
mod tests;
