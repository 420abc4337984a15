//! Where polynomials, the slopes of lens models, are positive.

/// A quick test that passes far from a root: whether lower bounds of the polynomial with these coefficients (constant
/// first) are positive on pieces of `[0, end]`.
pub(super) fn surely_positive(coefficients: &[f64], end: f64) -> bool {
    const PIECES: u32 = 8;
    let stop = |piece: u32| end * f64::from(piece) / f64::from(PIECES);
    (0..PIECES).all(|piece| {
        let (low, high) = (stop(piece), stop(piece + 1));
        let (mut least, mut low_power, mut high_power) = (0.0, 1.0, 1.0);
        for &coefficient in coefficients {
            least += coefficient * if coefficient > 0.0 { low_power } else { high_power };
            (low_power, high_power) = (low_power * low, high_power * high);
        }
        least > 0.0
    })
}

/// Where the polynomial with these coefficients (constant first) first changes its sign in `(0, end)`.
pub(super) fn first_root(coefficients: &[f64], end: f64) -> Option<f64> {
    roots(coefficients, end).first().copied()
}

/// Where the polynomial with these coefficients (constant first) changes its sign in `(0, end)`, in order.
///
/// Between two such places of its derivative a polynomial changes its sign at most once.
fn roots(coefficients: &[f64], end: f64) -> Vec<f64> {
    let value = |x: f64| coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c);
    if coefficients.len() < 2 {
        return Vec::new();
    }
    let derivative: Vec<f64> =
        coefficients.iter().enumerate().skip(1).map(|(power, c)| power as f64 * c).collect();
    let mut stops = vec![0.0];
    stops.extend(roots(&derivative, end));
    stops.push(end);
    let changes = stops.windows(2).filter(|ends| (value(ends[0]) > 0.0) != (value(ends[1]) > 0.0));
    changes.map(|ends| bisect(value, ends[0], ends[1])).collect()
}

/// Where `value` changes its sign between `a` and `b`: the last number on the side of `a`.
fn bisect(value: impl Fn(f64) -> f64, mut a: f64, mut b: f64) -> f64 {
    let is_positive = value(a) > 0.0;
    loop {
        let middle = 0.5 * (a + b);
        if middle <= a || middle >= b {
            return a;
        }
        if (value(middle) > 0.0) == is_positive {
            a = middle;
        } else {
            b = middle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_found_however_close() {
        let cubic = roots(&[-6.0, 11.0, -6.0, 1.0], 10.0);
        assert_eq!(cubic.len(), 3);
        assert!(cubic.iter().zip([1.0, 2.0, 3.0]).all(|(root, want)| (root - want).abs() < 1e-13));
        assert_eq!(roots(&[-6.0, 11.0, -6.0, 1.0], 2.5).len(), 2);
        // (1 - u)² (1 + u / 4) = 1 - 1.75 u + 0.5 u² + 0.25 u³ touches zero: a little higher it has no root, a
        // little lower two.
        let near_touch = |lift: f64| roots(&[1.0 + lift, -1.75, 0.5, 0.25], 9.0);
        assert_eq!(near_touch(1e-9), Vec::<f64>::new());
        let [first, second] = near_touch(-1e-8)[..] else { panic!("two roots: {:?}", near_touch(-1e-8)) };
        assert!(first < 1.0 && second > 1.0 && second - first < 3e-4);
    }

    #[test]
    fn the_quick_test_is_never_wrong() {
        for slope in [vec![1.0, -0.3], vec![1.0, -0.75, 0.1], vec![1.0, 0.2, -0.3, 0.0, 0.01]] {
            let end = first_root(&slope, 16.0).expect("a root");
            assert!(surely_positive(&slope, 0.8 * end) && !surely_positive(&slope, end + 1e-9), "{slope:?}");
        }
        assert!(!surely_positive(&[1.0, 1.0], f64::NAN));
    }
}
