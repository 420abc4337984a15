//! Which marched samples of a ray go on to the colour network and the backward pass.
//!
//! Walking front to back with the exclusive transmittance `T`, the ray ends where `T < stop_transmittance`. A
//! sample of weight `T α ≥ floor` is kept. A lighter one is kept with probability `p`, and its density
//! gradient is multiplied by `1/p`, so that the expected gradient stays what it would be without dropping.

use super::composite::{opacity, optical_depth};

/// When a sample is worth keeping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection {
    /// Transmittance below which a ray ends.
    pub stop_transmittance: f64,
    /// Weight from which on a sample is always kept.
    pub floor: f64,
    /// `p`: share of the lighter samples that is kept, in `[0, 1]`.
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
    /// Factor of its density gradient, and of nothing else.
    pub gain: f64,
}

/// The kept samples of a ray, in order.
///
/// `s`, `delta` and `uniform` (random numbers in `[0, 1)`) have one element per marched sample.
pub fn select(selection: &Selection, s: &[f64], delta: &[f64], uniform: &[f64]) -> Vec<Kept> {
    let mut kept = Vec::new();
    let mut depth_before = 0.0_f64;
    for (index, ((&s, &delta), &u)) in s.iter().zip(delta).zip(uniform).enumerate() {
        let transmittance = (-depth_before).exp();
        if transmittance < selection.stop_transmittance {
            break;
        }
        let depth = optical_depth(s, delta);
        if transmittance * opacity(depth) >= selection.floor {
            kept.push(Kept { index, gain: 1.0 });
        } else if u < selection.probability {
            let gain = 1.0 / selection.probability;
            kept.push(Kept { index, gain });
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
    const UNIFORM: [f64; 5] = [0.1, 0.9, 0.5, 0.9, 0.0];

    fn indices(selection: Selection) -> Vec<usize> {
        (select(&selection, &S, &DELTA, &UNIFORM).iter()).map(|kept| kept.index).collect()
    }

    /// Weights 10⁻⁵, 0.934, 6.6·10⁻⁷, 0.066; then T = e^{−e − e³} < 10⁻⁴ and the last is never reached.
    #[test]
    fn light_samples_are_kept_by_chance() {
        let kept = select(&Selection::default(), &S, &DELTA, &UNIFORM);
        let gains: Vec<f64> = kept.iter().map(|kept| kept.gain).collect();
        assert_eq!(indices(Selection::default()), [0, 1, 3]);
        assert_eq!(gains, [5.0, 1.0, 1.0]);
    }

    #[test]
    fn probability_and_floor_at_their_ends() {
        let probability = |probability| Selection { probability, ..Selection::default() };
        let no_floor = Selection { floor: 0.0, ..probability(0.0) };
        assert_eq!(indices(probability(0.0)), [1, 3]);
        assert_eq!(indices(probability(1.0)), [0, 1, 2, 3]);
        assert_eq!(indices(no_floor), [0, 1, 2, 3]);
        assert!(select(&no_floor, &[], &[], &[]).is_empty());
    }
}
