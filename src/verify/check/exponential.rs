//! The exponentials whose error must not depend on the driver.

use super::probe::Probe;
use super::{CheckResult, CheckedAdapter};
use crate::verify::reference::composite::{opacity, optical_depth};
use anyhow::Result;

/// `e^x`, opacity and optical depth, over their whole range and beyond it.
///
/// # Errors
/// When the device was lost or refuses the kernel.
pub fn exponentials(adapter: &CheckedAdapter) -> Result<CheckResult> {
    let mut result = CheckResult::new(
        "exponentials",
        2.5e-7,
        "four roundings: range reduction, series, product, 1 - e^-x",
    );
    let inputs = inputs();
    let body = "let x = input(0u);\n\
                output(0u, vec4(exp_accurate(x.x), opacity(x.y), optical_depth(x.z, x.w), 0.0));";
    let outputs = Probe { needs: "exp", variants: &[], body }.evaluate::<1, 1>(adapter, &inputs)?;
    for ([input], [got]) in inputs.iter().zip(&outputs) {
        let [x, tau, s, delta] = input.map(f64::from);
        let [exp, alpha, depth] = [got[0], got[1], got[2]].map(f64::from);
        match x {
            ..-87.0 => result.holds(exp == 0.0, || format!("e^{x:e} is {exp:e}")),
            _ => result.value(exp, x.min(88.0).exp(), x.min(88.0).exp(), || format!("e^{x:e}")),
        }
        let want = opacity(tau);
        result.value(alpha, want, want.max(SMALLEST), || format!("opacity at {tau:e}"));
        // Nothing passes behind 200, and what is below the range of single precision may be 0.
        let want = optical_depth(s, delta).min(200.0);
        result.value(depth, want, want.max(SMALLEST), || format!("optical depth of {s:e} and {delta:e}"));
    }
    Ok(result)
}

/// Smallest normal number of single precision over the rounding that is allowed: where it may be flushed to 0.
const SMALLEST: f64 = f32::MIN_POSITIVE as f64 / 1e-7;

/// `x` of `e^x`, `x` of the opacity, `s` and `δ` of the optical depth.
fn inputs() -> Vec<[[f32; 4]; 1]> {
    const COUNT: i32 = 40_000;
    let extreme_s = [1e30, -1e30, 0.0, 80.0, 104.0, -104.0, 1e-30, 3e38, -3e38, 200.0];
    let extreme_delta = [0.0, 1.0, 1e-38, 1e-45, 1e-40, 1e30, 3e38, 0.02, -1.0, 1.2e-38, 1.1e-38];
    (0..COUNT)
        .map(|i| {
            let part = f64::from(i) / f64::from(COUNT);
            let x = match i % 8 {
                0 => [1e-3, -1e-3, 0.0, -87.5, -100.0, 1e30, -1e30, 90.0][i as usize / 8 % 8],
                1 => -1e-3 + 2e-3 * part,
                _ => -87.0 + 175.0 * part,
            };
            // Around the switch from the series, and over 32 decades.
            let tau = if i % 4 == 0 { 0.3 + 0.1 * part } else { 10f64.powf(32.0 * part - 30.0) };
            let ln_delta = (i * 37 % 1009) as f64 / 1009.0 * 190.0 - 102.0;
            let (s, delta) = match i as usize {
                i if i % 4 == 0 => {
                    (extreme_s[i / 4 % extreme_s.len()], extreme_delta[i / 40 % extreme_delta.len()])
                }
                i if i % 2 == 0 => (-30.0 + 45.0 * part, 0.02),
                _ => (5.3 - 80.0 * part - ln_delta, ln_delta.exp()),
            };
            [[x, tau, s, delta].map(|x| x as f32)]
        })
        .collect()
}
