//! What a comparison with the reference found.

use crate::verify::reference::vectors::NOT_FINITE;
use serde::Serialize;

/// How far a kernel is from the reference at most.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckResult {
    /// What was compared.
    pub name: String,
    /// Values and conditions compared.
    pub cases: usize,
    /// Largest error relative to the size of the value's terms; [`NOT_FINITE`] where a value is not finite or a
    /// condition does not hold.
    pub worst: f64,
    /// Largest error allowed.
    pub bound: f64,
    /// Whether every error is within the bound, and there was something to compare.
    pub pass: bool,
    /// Where the bound comes from.
    pub source: &'static str,
    /// The case with the largest error.
    pub case: String,
}

impl CheckResult {
    /// Nothing compared yet.
    #[must_use]
    pub fn new(name: impl Into<String>, bound: f64, source: &'static str) -> Self {
        Self { name: name.into(), cases: 0, worst: 0.0, bound, pass: false, source, case: "none".into() }
    }

    /// Compares one value; `scale` is the size of its terms.
    pub fn value(&mut self, got: f64, want: f64, scale: f64, case: impl FnOnce() -> String) {
        let error = (got - want).abs() / scale.abs().max(f64::MIN_POSITIVE);
        // A difference of nothing is none, whatever the scale.
        let error = if got.to_bits() == want.to_bits() { 0.0 } else { error };
        let error = if error.is_finite() { error.min(NOT_FINITE) } else { NOT_FINITE };
        self.error(error, || format!("{}: {got:e} instead of {want:e}", case()));
    }

    /// Counts an error that was measured elsewhere.
    pub fn error(&mut self, error: f64, case: impl FnOnce() -> String) {
        self.cases += 1;
        let error = if error.is_nan() { NOT_FINITE } else { error };
        if error > self.worst {
            self.worst = error;
            self.case = case();
        }
        self.pass = self.worst <= self.bound;
    }

    /// Compares `got` with `want`, one scale each.
    pub fn each<G, W>(&mut self, case: &str, got: &[G], want: &[W], scale: impl Fn(usize) -> f64)
    where
        G: Copy + Into<f64>,
        W: Copy + Into<f64>,
    {
        self.holds(got.len() == want.len(), || {
            format!("{case}: {} values instead of {}", got.len(), want.len())
        });
        for (index, (&got, &want)) in got.iter().zip(want).enumerate() {
            self.value(got.into(), want.into(), scale(index), || format!("{case}, value {index}"));
        }
    }

    /// Compares `got` with `want`, all on the scale of the largest value wanted.
    pub fn all<G, W>(&mut self, case: &str, got: &[G], want: &[W])
    where
        G: Copy + Into<f64>,
        W: Copy + Into<f64>,
    {
        let scale = largest(want);
        self.each(case, got, want, |_| scale);
    }

    /// Counts a condition that must hold exactly.
    pub fn holds(&mut self, condition: bool, case: impl FnOnce() -> String) {
        self.error(if condition { 0.0 } else { NOT_FINITE }, case);
    }
}

/// The largest magnitude, at least 1e-30: what the error of a gradient is relative to.
pub(super) fn largest<T: Copy + Into<f64>>(values: &[T]) -> f64 {
    values.iter().fold(1e-30, |most, &value| most.max(value.into().abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_relative_and_the_worst_is_named() {
        let mut result = CheckResult::new("test", 1e-3, "a test");
        assert!(!result.pass, "nothing was compared");
        result.all("small", &[1.0, 100.0], &[1.01, 100.0]);
        assert!(result.pass && result.cases == 3 && (result.worst - 1e-4).abs() < 1e-12);
        result.each("large", &[5.0], &[4.0], |_| 100.0);
        assert!(
            !result.pass && result.case.contains("large, value 0: 5e0 instead of 4e0"),
            "{}",
            result.case
        );
    }

    #[test]
    fn what_is_not_a_number_fails() {
        for got in [f64::NAN, f64::INFINITY] {
            let mut result = CheckResult::new("test", 1.0, "a test");
            result.value(got, 1.0, 1.0, || "here".into());
            assert!(!result.pass && result.worst == NOT_FINITE);
        }
        let mut result = CheckResult::new("test", 1.0, "a test");
        result.all("short", &[1.0], &[1.0, 2.0]);
        assert!(!result.pass);
        result = CheckResult::new("test", 1.0, "a test");
        result.value(0.0, 0.0, 0.0, || "nothing".into());
        assert!(result.pass && result.worst == 0.0);
        result.value(1e-300, 0.0, 0.0, || "something".into());
        assert!(!result.pass);
    }
}
