//! Which marched samples of a ray go on to the colour network and the backward pass.
//!
//! Walking front to back with the exclusive transmittance `T`, the ray ends where `T < stop_transmittance`. A
//! sample of weight `w = T α` is kept with probability `p = clamp(w / floor, probability, 1)` and then stands for
//! `1/p` samples: its step becomes `δ/p`, so that the optical depth of the ray stays what it was in expectation.
//! The choices are spread evenly (systematic sampling): with one random number `u` per ray, sample `i` is kept
//! where `u + p_1 + … + p_i` passes an integer. Heavy samples (`w ≥ floor`) are always kept as they are.

use super::composite::{opacity, optical_depth};

/// When a sample is worth keeping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection {
    /// Transmittance below which a ray ends.
    pub stop_transmittance: f64,
    /// Weight from which on a sample is always kept, above 0.
    pub floor: f64,
    /// The least `p`, in `[0, 1]`.
    pub probability: f64,
}

impl Default for Selection {
    fn default() -> Self {
        Self { stop_transmittance: 1e-4, floor: 1e-3, probability: 0.2 }
    }
}

/// A sample that is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kept {
    /// Which of the marched samples.
    pub index: usize,
    /// `1/p`: factor of its step.
    pub gain: f64,
}

/// The kept samples of a ray, in order.
///
/// `s` and `delta` have one element per marched sample; `u` is the ray's random number in `[0, 1)`.
pub fn select(selection: &Selection, s: &[f64], delta: &[f64], u: f64) -> Vec<Kept> {
    let mut kept = Vec::new();
    let mut depth_before = 0.0_f64;
    let mut share = u;
    for (index, (&s, &delta)) in s.iter().zip(delta).enumerate() {
        let transmittance = (-depth_before).exp();
        if transmittance < selection.stop_transmittance {
            break;
        }
        let depth = optical_depth(s, delta);
        let weight = transmittance * opacity(depth);
        let probability = (weight / selection.floor).min(1.0).max(selection.probability);
        share += probability;
        if share >= 1.0 {
            share -= 1.0;
            kept.push(Kept { index, gain: 1.0 / probability });
        }
        depth_before += depth;
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: [f64; 5] = [0.0, 1.0, 0.0, 3.0, 0.0];
    const DELTA: [f64; 5] = [1e-5, 1.0, 1e-5, 1.0, 1.0];

    fn indices(selection: Selection, u: f64) -> Vec<usize> {
        (select(&selection, &S, &DELTA, u).iter()).map(|kept| kept.index).collect()
    }

    /// Weights 10⁻⁵, 0.934, 6.6·10⁻⁷, 0.066; then T = e^{−e − e³} < 10⁻⁴ and the last is never reached.
    #[test]
    fn light_samples_are_kept_by_chance() {
        let kept = select(&Selection::default(), &S, &DELTA, 0.85);
        let gains: Vec<f64> = kept.iter().map(|kept| kept.gain).collect();
        assert_eq!(indices(Selection::default(), 0.85), [0, 1, 3]);
        assert_eq!(gains, [5.0, 1.0, 1.0]);
        assert_eq!(indices(Selection::default(), 0.65), [1, 2, 3]);
    }

    #[test]
    fn probability_at_its_ends() {
        let probability = |probability| Selection { probability, ..Selection::default() };
        assert_eq!(indices(probability(0.0), 0.5), [1, 3]);
        assert_eq!(indices(probability(1.0), 0.5), [0, 1, 2, 3]);
        assert!(select(&probability(0.0), &[], &[], 0.5).is_empty());
    }

    /// Thin haze of 1000 equal samples: a tenth of them carries the whole optical depth.
    #[test]
    fn optical_depth_is_kept() {
        let (s, delta) = (vec![0.0; 1000], vec![1e-4; 1000]);
        let selection = Selection { floor: 1e-3, probability: 0.0, ..Selection::default() };
        let kept = select(&selection, &s, &delta, 0.3);
        let total: f64 = kept.iter().map(|kept| kept.gain * 1e-4).sum();
        assert!((90..=100).contains(&kept.len()), "{}", kept.len());
        assert!((total - 0.1).abs() < 2e-3, "{total}");
    }
}
