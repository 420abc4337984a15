//! Golden rays: files of rays with what compositing must make of them, and a ray's error against them.
//!
//! An error is |got − expected| over a scale, the size of the terms that the expected value is summed from: it
//! means the same for a value that cancels as for one that does not.

use std::path::Path;

use anyhow::{Context, Result, anyhow, bail, ensure};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::composite::{
    CompositeInput, CompositeOutput, composite, d_rendered_by_s, optical_depths, transmittances, with_opacity,
};
use crate::config::Transmittance;

/// Smallest scale of an error.
pub const MIN_SCALE: f64 = 1e-30;
/// Error of a ray that is not finite.
pub const NOT_FINITE: f64 = 1e30;

/// A file of golden rays. Fields that are not named here are ignored.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GoldenFile {
    /// Convention that the expected values follow.
    pub transmittance: Transmittance,
    /// `M`: rays in the batch.
    pub rays_in_batch: u32,
    /// Sum of the rays' losses.
    pub loss: Option<f64>,
    /// The rays.
    pub rays: Vec<GoldenRay>,
}

/// One golden ray.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct GoldenRay {
    /// What is special about it.
    pub name: String,
    /// Log-densities `[samples]`.
    pub s: Vec<f64>,
    /// Steps `[samples]`.
    pub delta: Vec<f64>,
    /// Colours `[samples, 3]`.
    pub c: Vec<[f64; 3]>,
    /// Target colour.
    pub gt: [f64; 3],
    /// Target opacity.
    pub gt_alpha: f64,
    /// Colour behind the ray.
    pub background: [f64; 3],
    /// What must come out.
    pub expect: Expected,
}

/// The expected values of a ray, and the scales of their errors.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Expected {
    /// Composited colour and opacity.
    #[serde(rename = "R")]
    pub rendered: [f64; 4],
    /// Squared differences from the target.
    pub loss_terms: [f64; 4],
    /// The ray's share of the loss.
    pub loss: f64,
    /// Weights `[samples]`, their own scale.
    pub weights: Vec<f64>,
    /// ∂loss/∂colour `[samples, 3]`.
    #[serde(rename = "dL_dc")]
    pub d_color: Vec<[f64; 3]>,
    /// ∂loss/∂s `[samples]`.
    #[serde(rename = "dL_ds")]
    pub d_s: Vec<f64>,
    /// Scale of `R`: `Σ w_i |c_xi| + T_{N+1} |b_x|`.
    #[serde(rename = "R_scale")]
    pub rendered_scale: [f64; 4],
    /// Scale of `loss`: `Σ_x (|R_x| + |g_x|)² / (4M)`.
    pub loss_scale: f64,
    /// Scale of `dL_dc`: `(|R_x| + |g_x|)/(2M) w_i`.
    #[serde(rename = "dL_dc_scale")]
    pub d_color_scale: Vec<[f64; 3]>,
    /// Scale of `dL_ds`:
    /// `1/(2M) Σ_x [|R_x − g_x| τ_i (|own| + |behind| + |T_{N+1} b_x|) + (|R_x| + |g_x|) |dR_x/ds_i|]`.
    #[serde(rename = "dL_ds_scale")]
    pub d_s_scale: Vec<f64>,
}

/// How far a ray is from what is expected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayError {
    /// Largest of all errors; [`NOT_FINITE`] if anything is missing or not finite.
    pub error: f64,
    /// Whether every value is there and finite.
    pub finite: bool,
    /// The quantity with the largest error.
    pub quantity: &'static str,
}

impl GoldenFile {
    /// Reads a file of golden rays and checks that the lengths in it agree.
    pub fn load(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read the golden rays in {}", path.display()))?;
        Self::parse(&text).with_context(|| format!("{} is not a file of golden rays", path.display()))
    }

    /// Reads golden rays from JSON text and checks that every input is a number of single precision and that the
    /// lengths in it agree; an error names the ray and the field.
    pub fn parse(text: &str) -> Result<Self> {
        let Unread { transmittance, rays_in_batch, loss, rays } =
            read(&mut serde_json::Deserializer::from_str(text))?;
        ensure!(rays_in_batch > 0, "rays_in_batch is 0, expected at least 1");
        let rays = rays.into_iter().enumerate().map(|(i, ray)| {
            let name = ray.get("name").and_then(Value::as_str).unwrap_or("without a name").to_owned();
            GoldenRay::parse(ray).with_context(|| format!("ray {i} \"{name}\""))
        });
        Ok(Self { transmittance, rays_in_batch, loss, rays: rays.collect::<Result<_>>()? })
    }

    /// A ray of this file as compositing takes it.
    pub fn input<'a>(&self, ray: &'a GoldenRay) -> CompositeInput<'a> {
        let [r, g, b] = ray.gt;
        CompositeInput {
            s: &ray.s,
            delta: &ray.delta,
            color: &ray.c,
            target: [r, g, b, ray.gt_alpha],
            background: ray.background,
            rays_in_batch: self.rays_in_batch,
        }
    }
}

/// A file whose rays are not looked at yet.
#[derive(Deserialize)]
struct Unread {
    transmittance: Transmittance,
    rays_in_batch: u32,
    loss: Option<f64>,
    rays: Vec<Value>,
}

/// Reads a value; an error names the field that is wrong.
fn read<'de, T: Deserialize<'de>>(from: impl serde::Deserializer<'de>) -> Result<T> {
    serde_path_to_error::deserialize(from).map_err(|error| match error.path().iter().next() {
        Some(_) => anyhow!("{}: {}", error.path(), error.inner()),
        None => anyhow!("{}", error.inner()),
    })
}

impl GoldenRay {
    fn parse(ray: Value) -> Result<Self> {
        let ray: Self = read(ray)?;
        ray.check_lengths()?;
        let color = ray.c.as_flattened();
        for (name, values) in [
            ("s", &ray.s[..]),
            ("delta", &ray.delta),
            ("c", color),
            ("gt", &ray.gt),
            ("gt_alpha", &[ray.gt_alpha]),
            ("background", &ray.background),
        ] {
            let most = f64::from(f32::MAX);
            if let Some(value) = values.iter().find(|value| value.abs() > most) {
                bail!("{name} holds {value:e}, expected numbers of single precision, up to {most:.2e}");
            }
        }
        Ok(ray)
    }

    fn check_lengths(&self) -> Result<()> {
        let (samples, expect) = (self.s.len(), &self.expect);
        for (name, length) in [
            ("delta", self.delta.len()),
            ("c", self.c.len()),
            ("expect.weights", expect.weights.len()),
            ("expect.dL_dc", expect.d_color.len()),
            ("expect.dL_dc_scale", expect.d_color_scale.len()),
            ("expect.dL_ds", expect.d_s.len()),
            ("expect.dL_ds_scale", expect.d_s_scale.len()),
        ] {
            ensure!(length == samples, "{name} has {length} elements, expected {samples}, as many as s");
        }
        Ok(())
    }
}

impl Expected {
    /// What the reference makes of a ray, and the scales of the fields above.
    pub fn of(convention: Transmittance, ray: &CompositeInput) -> Self {
        let output = composite(convention, ray);
        let m = f64::from(ray.rays_in_batch.max(1));
        let both: [f64; 4] = std::array::from_fn(|x| output.rendered[x].abs() + ray.target[x].abs());
        let unblocked = with_opacity(ray.background, 0.0).map(|b| output.transmittance_end * b.abs());
        let mut rendered_scale = unblocked;
        for (w, &color) in output.weights.iter().zip(ray.color) {
            let color = with_opacity(color, 1.0);
            (0..4).for_each(|x| rendered_scale[x] += w * color[x].abs());
        }
        let by_s = d_rendered_by_s(convention, ray);
        let terms = terms_of_d_s(convention, ray, &output.weights, unblocked);
        let d_s_scale = (by_s.iter().zip(&terms)).map(|(by_s, terms)| {
            let of_channel = |x: usize| output.loss_terms[x].sqrt() * terms[x] + both[x] * by_s[x].abs();
            (0..4).map(of_channel).sum::<f64>() / (2.0 * m)
        });
        let d_color_scale = output.weights.iter().map(|w| std::array::from_fn(|x| both[x] / (2.0 * m) * w));
        Self {
            rendered_scale,
            loss_scale: both.iter().map(|x| x * x).sum::<f64>() / (4.0 * m),
            d_color_scale: d_color_scale.collect(),
            d_s_scale: d_s_scale.collect(),
            rendered: output.rendered,
            loss_terms: output.loss_terms,
            loss: output.loss,
            weights: output.weights,
            d_color: output.d_color,
            d_s: output.d_s,
        }
    }
}

/// `τ_i (|own| + |behind| + |T_{N+1} b_x|)` of every sample and channel, what dR/ds_i is summed from.
fn terms_of_d_s(
    convention: Transmittance,
    ray: &CompositeInput,
    weights: &[f64],
    unblocked: [f64; 4],
) -> Vec<[f64; 4]> {
    let depths = optical_depths(ray);
    let transmittances = transmittances(convention, &depths);
    let mut behind = [0.0; 4];
    let mut terms = vec![[0.0; 4]; depths.len()];
    for i in (0..depths.len()).rev() {
        let color = with_opacity(ray.color[i], 1.0);
        let passing = transmittances[i] * (-depths[i]).exp();
        for x in 0..4 {
            let later: f64 = behind[x];
            behind[x] += weights[i] * color[x];
            let behind = if convention == Transmittance::Exclusive { later } else { behind[x] };
            terms[i][x] = depths[i] * ((passing * color[x]).abs() + behind.abs() + unblocked[x]);
        }
    }
    terms
}

impl RayError {
    /// The error of what was made of a ray.
    pub fn new(expect: &Expected, got: &CompositeOutput) -> Self {
        let (d_color, d_color_expected) = (got.d_color.as_flattened(), &expect.d_color);
        let quantities = [
            ("dL_ds", worst(&got.d_s, &expect.d_s, &expect.d_s_scale)),
            ("dL_dc", worst(d_color, d_color_expected.as_flattened(), expect.d_color_scale.as_flattened())),
            ("weights", worst(&got.weights, &expect.weights, &expect.weights)),
            ("R", worst(&got.rendered, &expect.rendered, &expect.rendered_scale)),
            ("loss", worst(&[got.loss], &[expect.loss], &[expect.loss_scale])),
        ];
        let mut result =
            Self { error: 0.0, finite: got.loss_terms.iter().all(|term| term.is_finite()), quantity: "none" };
        for (quantity, error) in quantities {
            match error {
                Some(error) if error > result.error => (result.error, result.quantity) = (error, quantity),
                Some(_) => {}
                None => result.finite = false,
            }
        }
        if !result.finite {
            result.error = NOT_FINITE;
        }
        result
    }
}

/// Largest `|got − expected| / max(scale, 10⁻³⁰)`, 0 without values; `None` where one is missing or not
/// finite.
fn worst(got: &[f64], expected: &[f64], scale: &[f64]) -> Option<f64> {
    if got.len() != expected.len() || !got.iter().all(|value| value.is_finite()) {
        return None;
    }
    let errors = (got.iter().zip(expected).zip(scale))
        .map(|((got, expected), scale)| (got - expected).abs() / scale.max(MIN_SCALE));
    Some(errors.fold(0.0, f64::max).min(NOT_FINITE))
}
