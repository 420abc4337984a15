//! Counter-based random numbers, equal to the last bit on the host and in the kernels.
//!
//! The mixing function is PCG's output permutation over one step of a linear congruential generator (Jarzynski
//! & Olano 2020, "Hash functions for GPU rendering"). A number depends on nothing but its coordinates, so any
//! order of evaluation gives the same numbers.

/// Mixes 32 bits.
pub fn pcg(value: u32) -> u32 {
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// 32 random bits: of a run's `seed`, a training `step`, an `index` (a ray, a cell) and one of its dimensions.
pub fn random_u32(seed: u32, step: u32, index: u32, dimension: u32) -> u32 {
    let run = pcg(seed);
    let step = pcg(step.wrapping_add(run));
    let index = pcg(index.wrapping_add(step));
    pcg(dimension.wrapping_add(index))
}

/// The upper 24 of 32 random bits as a number in `[0, 1)`.
pub fn uniform(bits: u32) -> f32 {
    (bits >> 8) as f32 * 2.0_f32.powi(-24)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `pcg(0)` by hand: state = 2891336453, shift = 10 + 4.
    #[test]
    fn mixing_by_hand() {
        let state = 2_891_336_453_u32;
        assert_eq!(state >> 28, 10);
        let word = ((state >> 14) ^ state).wrapping_mul(277_803_737);
        assert_eq!(pcg(0), (word >> 22) ^ word);
        assert_eq!(
            random_u32(1, 2, 3, 4),
            pcg(4_u32.wrapping_add(pcg(3_u32.wrapping_add(pcg(2_u32.wrapping_add(pcg(1)))))))
        );
    }

    #[test]
    fn uniform_covers_the_unit_interval() {
        assert_eq!(uniform(0), 0.0);
        assert!(uniform(u32::MAX) < 1.0);
        let count = 1 << 14;
        let mean =
            (0..count).map(|i| f64::from(uniform(random_u32(7, 0, i, 0)))).sum::<f64>() / f64::from(count);
        assert!((mean - 0.5).abs() < 0.01);
    }
}
