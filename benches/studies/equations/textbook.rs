//! The textbook gradient by log-density, "total minus prefix": not used for training, kept to show its error.
//!
//! ```text
//! exclusive:  dR/ds_i = τ_i [T_{i+1} c_i      − Σ_{n>i} w_n c_n − T_{N+1} b]
//! inclusive:  dR/ds_i = τ_i [T_i (1 − α_i) c_i − Σ_{n≥i} w_n c_n − T_{N+1} b]
//! ```
//!
//! Evaluated front to back, the sum over later samples is `R − Σ_prefix`: it cancels once most of the colour
//! is in the prefix, and `τ_i` multiplies what rounding left. [`nerf::verify::reference::composite`] has the stable form.

use nerf::config::Transmittance;
use nerf::verify::reference::composite::CompositeInput;

/// Arithmetic in which the textbook gradient is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Precision {
    /// As f64 gives it.
    #[allow(dead_code, reason = "only the tests ask for it, to show that the formula is right")]
    Double,
    /// Every operation rounded to f32, as a kernel would; overflow then gives infinities and NaN.
    Single,
}

impl Precision {
    fn round(self, value: f64) -> f64 {
        match self {
            Self::Double => value,
            Self::Single => f64::from(value as f32),
        }
    }
}

/// ∂loss/∂s `[samples]` in the textbook form. Nothing is clamped: the result may be wrong or not finite.
pub(crate) fn textbook_d_s(
    convention: Transmittance,
    precision: Precision,
    ray: &CompositeInput,
) -> Vec<f64> {
    let round = |value| precision.round(value);
    let m = f64::from(ray.rays_in_batch.max(1));
    let mut d_s = vec![0.0; ray.s.len()];
    for x in 0..4 {
        let color = |i: usize| if x < 3 { ray.color[i][x] } else { 1.0 };
        let background = if x < 3 { ray.background[x] } else { 0.0 };
        let steps = walk(convention, precision, ray);

        let mut rendered = 0.0;
        for (i, step) in steps.iter().enumerate() {
            rendered = round(rendered + round(step.weight * color(i)));
        }
        let end = steps.last().map_or(1.0, |step| step.after);
        rendered = round(rendered + round(end * background));
        let d_rendered = round(round(rendered - ray.target[x]) / round(2.0 * m));

        let mut prefix = 0.0;
        for (i, step) in steps.iter().enumerate() {
            let with_sample = round(prefix + round(step.weight * color(i)));
            let own = round(step.own * color(i));
            let behind = match convention {
                Transmittance::Exclusive => round(rendered - with_sample),
                Transmittance::Inclusive => round(rendered - prefix),
            };
            let d_rendered_by_s = round(step.depth * round(own - behind));
            d_s[i] = round(d_s[i] + round(d_rendered * d_rendered_by_s));
            prefix = with_sample;
        }
    }
    d_s
}

/// One sample of the forward walk.
struct Step {
    /// `τ_i`.
    depth: f64,
    /// `w_i`.
    weight: f64,
    /// What multiplies the sample's own colour: `T_{i+1}`, or `T_i (1 − α_i)`.
    own: f64,
    /// Transmittance behind the sample.
    after: f64,
}

fn walk(convention: Transmittance, precision: Precision, ray: &CompositeInput) -> Vec<Step> {
    let round = |value| precision.round(value);
    let mut before = 1.0;
    (ray.s.iter().zip(ray.delta))
        .map(|(&s, &delta)| {
            let depth = round(round(s.exp()) * delta);
            let alpha = round(1.0 - round((-depth).exp()));
            let after = round(before * round(1.0 - alpha));
            let (t, own) = match convention {
                Transmittance::Exclusive => (before, after),
                Transmittance::Inclusive => (after, round(after * round(1.0 - alpha))),
            };
            before = after;
            Step { depth, weight: round(t * alpha), own, after }
        })
        .collect()
}
