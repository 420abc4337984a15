//! What turns raw network outputs into log-density and colour, and its slope.

use super::probe::Probe;
use super::{CheckResult, CheckedAdapter};
use crate::verify::reference::ColorRange;
use crate::verify::reference::activation::{
    MAX_LOG_COLOR, MAX_LOG_DENSITY, color, color_backward, log_density, log_density_backward,
};
use anyhow::Result;

/// Values and slopes of the activations of colour and density, also where they are clamped.
///
/// # Errors
/// When the device was lost or refuses the kernel.
pub fn activations(adapter: &CheckedAdapter) -> Result<CheckResult> {
    let mut result = CheckResult::new("activations", 5e-7, "eight roundings: e^x, sum, quotient, product");
    compare(adapter, &mut result, ColorRange::Ldr, "sigmoid")?;
    compare(adapter, &mut result, ColorRange::Hdr, "exponential")?;
    Ok(result)
}

fn compare(
    adapter: &CheckedAdapter,
    result: &mut CheckResult,
    range: ColorRange,
    activation: &str,
) -> Result<()> {
    let body = "let raw = input(0u).x;\n\
                let gradient = input(0u).y;\n\
                let color = color_activation(vec3(raw)).x;\n\
                let d_color = color_activation_backward(vec3(color), vec3(gradient)).x;\n\
                output(0u, vec4(color, d_color, density_log(raw), density_log_backward(raw, gradient)));";
    let inputs = inputs();
    let outputs = Probe { needs: "activation, density", variants: &[("activation", activation)], body }
        .evaluate::<1, 1>(adapter, &inputs)?;
    for ([[raw, gradient, ..]], [got]) in inputs.into_iter().zip(outputs) {
        let (raw, gradient, got) = (f64::from(raw), f64::from(gradient), got.map(f64::from));
        let case = |what: &str| format!("{range:?}: {what} at {raw:e}");
        let want = color(range, raw);
        result.value(got[0], want, want.max(1e-30), || case("colour"));
        let slope = color_backward(range, raw, gradient);
        result.value(got[1], slope, gradient.abs() * want.max(1e-30), || case("slope of colour"));
        let log = log_density(raw);
        result.value(got[2], log, log.abs(), || case("log-density"));
        let slope = log_density_backward(raw, gradient);
        result.value(got[3], slope, gradient.abs(), || case("slope of log-density"));
    }
    Ok(())
}

/// Raw outputs and gradients. Right at the clamp of the colours rounding may decide.
fn inputs() -> Vec<[[f32; 4]; 1]> {
    let special = [0.0, 1e-30, -1e-30, 1e30, -1e30, 3e38, -3e38, 87.5, -87.5, -86.9, 200.0, -200.0];
    let clamps = [MAX_LOG_DENSITY, MAX_LOG_DENSITY + 1e-4, MAX_LOG_COLOR + 1e-4, MAX_LOG_COLOR - 1e-4];
    let even = (0..4000).map(|i| -86.0 + f64::from(i) / 4000.0 * 172.0);
    let near = (0..4000).map(|i| -6.0 + f64::from(i) / 4000.0 * 12.0);
    let raw = special.into_iter().chain(clamps).chain(even).chain(near);
    raw.flat_map(|raw| [0.75, -1.5].map(|gradient| [[raw as f32, gradient, 0.0, 0.0]])).collect()
}
