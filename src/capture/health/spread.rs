//! The spread of some numbers, and how it reads.

use crate::support::statistics::median;
use serde::Serialize;

/// The least, the middle and the largest of some numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// The least.
    pub min: f64,
    /// The middle one, the upper of two.
    pub median: f64,
    /// The largest.
    pub max: f64,
}

impl Spread {
    /// That of `values`; all 0 without any.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let values: Vec<f64> = values.into_iter().collect();
        let Some(median) = median(values.iter().copied()) else { return Self::default() };
        let extreme = |of: fn(f64, f64) -> f64| values.iter().copied().fold(median, of);
        Self { min: extreme(f64::min), median, max: extreme(f64::max) }
    }

    /// As text: one number where all are the same as `say` prints them.
    #[must_use]
    pub fn describe(&self, say: impl Fn(f64) -> String) -> String {
        let [min, median, max] = [self.min, self.median, self.max].map(say);
        if min == max { median } else { format!("{min} to {max}, median {median}") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads_are_short_where_they_can_be() {
        let say = |value: f64| format!("{value:.1} m");
        assert_eq!(Spread::of([3.0, 1.0, 2.0]).describe(say), "1.0 m to 3.0 m, median 2.0 m");
        assert_eq!(Spread::of([1.0, 1.01]).describe(say), "1.0 m");
        assert_eq!(Spread::of([]), Spread::default());
    }
}
