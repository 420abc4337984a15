//! The optimiser (Kingma & Ba 2015, algorithm 1).

/// Constants of the update.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adam {
    /// Decay of the first moment.
    pub beta1: f64,
    /// Decay of the second moment.
    pub beta2: f64,
    /// Added to the root of the second moment.
    pub epsilon: f64,
    /// Factor of the parameter that is added to its gradient.
    pub l2: f64,
    /// Whether a parameter with a gradient of exactly 0 keeps itself and its moments.
    pub skip_zero: bool,
}

/// First and second moments, one pair per parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Moments {
    /// `m`: decayed mean of the gradient.
    pub first: Vec<f64>,
    /// `v`: decayed mean of its square.
    pub second: Vec<f64>,
}

/// Where in training an update happens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    /// Global number of the step, from 1.
    pub step: u32,
    /// Learning rate of this step.
    pub learning_rate: f64,
}

impl Moments {
    /// Zero moments of `count` parameters.
    pub fn new(count: usize) -> Self {
        Self { first: vec![0.0; count], second: vec![0.0; count] }
    }
}

impl Adam {
    /// The constants of the grid table: β = (0.9, 0.99), ε = 10⁻¹⁵, untouched entries skipped.
    pub fn table() -> Self {
        Self { beta1: 0.9, beta2: 0.99, epsilon: 1e-15, l2: 0.0, skip_zero: true }
    }

    /// The constants of the networks: as the table's, with L2 10⁻⁶ and nothing skipped.
    pub fn mlp() -> Self {
        Self { l2: 1e-6, skip_zero: false, ..Self::table() }
    }

    /// One update of every parameter `p` with gradient `g`, at step `t` and learning rate `η`:
    ///
    /// ```text
    /// g ← g + l2 p      m ← β1 m + (1 − β1) g      v ← β2 v + (1 − β2) g²
    /// p ← p − η (m / (1 − β1^t)) / (√(v / (1 − β2^t)) + ε)
    /// ```
    pub fn update(
        &self,
        schedule: Schedule,
        moments: &mut Moments,
        parameters: &mut [f64],
        gradient: &[f64],
    ) {
        let t = f64::from(schedule.step.max(1));
        let correction1 = 1.0 - self.beta1.powf(t);
        let correction2 = 1.0 - self.beta2.powf(t);
        let moments = moments.first.iter_mut().zip(&mut moments.second);
        for ((p, &d_p), (m, v)) in parameters.iter_mut().zip(gradient).zip(moments) {
            if self.skip_zero && d_p == 0.0 {
                continue;
            }
            let g = d_p + self.l2 * *p;
            *m = self.beta1 * *m + (1.0 - self.beta1) * g;
            *v = self.beta2 * *v + (1.0 - self.beta2) * g * g;
            let m_hat = *m / correction1;
            let v_hat = *v / correction2;
            *p -= schedule.learning_rate * m_hat / (v_hat.sqrt() + self.epsilon);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(step: u32) -> Schedule {
        Schedule { step, learning_rate: 0.1 }
    }

    /// g = 2 then −1 on p = 1, by hand:
    /// m = 0.2, v = 0.04, m̂ = 2, v̂ = 4, p = 1 − 0.1 · 2/2 = 0.9;
    /// m = 0.18 − 0.1 = 0.08, v = 0.0396 + 0.01 = 0.0496, m̂ = 0.08/0.19, v̂ = 0.0496/0.0199.
    #[test]
    fn two_steps_by_hand() {
        let adam = Adam::table();
        let (mut p, mut moments) = (vec![1.0], Moments::new(1));
        adam.update(at(1), &mut moments, &mut p, &[2.0]);
        assert!((p[0] - 0.9).abs() < 1e-12);
        adam.update(at(2), &mut moments, &mut p, &[-1.0]);
        assert!((moments.first[0] - 0.08).abs() < 1e-12);
        assert!((moments.second[0] - 0.0496).abs() < 1e-12);
        let expected = 0.9 - 0.1 * (0.08 / 0.19) / (0.0496_f64 / 0.0199).sqrt();
        assert!((p[0] - expected).abs() < 1e-12);
    }

    #[test]
    fn zero_gradient_is_skipped_only_in_the_table() {
        let start = Moments { first: vec![0.5], second: vec![0.25] };
        let (mut p, mut moments) = (vec![1.0], start.clone());
        Adam::table().update(at(3), &mut moments, &mut p, &[0.0]);
        assert_eq!((p[0], &moments), (1.0, &start));
        Adam::mlp().update(at(3), &mut moments, &mut p, &[0.0]);
        assert!(p[0] < 1.0 && moments.first[0] < 0.5);
        assert!((moments.first[0] - (0.45 + 0.1 * 1e-6)).abs() < 1e-15);
    }

    #[test]
    fn nothing_to_divide_by_stays_finite() {
        let (mut p, mut moments) = (vec![0.0], Moments::new(1));
        Adam::mlp().update(at(1), &mut moments, &mut p, &[0.0]);
        assert_eq!(p[0], 0.0);
    }
}
