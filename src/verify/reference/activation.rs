//! What turns raw network outputs into log-density and colour.
//!
//! Both exponentials are clamped. The gradient ignores a clamp unless following it would push the raw
//! output further beyond: a step of descent moves the output by `−gradient`, so a negative gradient is
//! blocked there and a positive one leads back.

use super::ColorRange;

/// Largest log-density: `exp(15)` per unit of δ is opaque at any step in use.
pub const MAX_LOG_DENSITY: f64 = 15.0;
/// Largest exponent of a high-dynamic-range colour, about 10⁵.
pub const MAX_LOG_COLOR: f64 = 11.5;

/// Log-density `s = min(raw, 15)`.
pub fn log_density(raw: f64) -> f64 {
    raw.min(MAX_LOG_DENSITY)
}

/// ∂loss/∂raw of [`log_density`], given `d_s`.
pub fn log_density_backward(raw: f64, d_s: f64) -> f64 {
    if raw > MAX_LOG_DENSITY && d_s < 0.0 { 0.0 } else { d_s }
}

/// One colour channel: `1 / (1 + exp(−raw))` in low, `exp(min(raw, 11.5))` in high dynamic range.
pub fn color(range: ColorRange, raw: f64) -> f64 {
    match range {
        ColorRange::Ldr => 1.0 / (1.0 + (-raw).exp()),
        ColorRange::Hdr => raw.min(MAX_LOG_COLOR).exp(),
    }
}

/// ∂loss/∂raw of [`color`], given `d_color`: `d_color c (1 − c)` in low, `d_color c` in high dynamic range.
pub fn color_backward(range: ColorRange, raw: f64, d_color: f64) -> f64 {
    let c = color(range, raw);
    match range {
        ColorRange::Ldr => d_color * c * (1.0 - c),
        ColorRange::Hdr if raw > MAX_LOG_COLOR && d_color < 0.0 => 0.0,
        ColorRange::Hdr => d_color * c,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clamps_let_gradients_lead_back() {
        assert_eq!(log_density(16.0), 15.0);
        assert_eq!(log_density_backward(16.0, -1.0), 0.0);
        assert_eq!(log_density_backward(16.0, 1.0), 1.0);
        assert_eq!(log_density_backward(15.0, -1.0), -1.0);
        let limit = MAX_LOG_COLOR.exp();
        assert_eq!(color(ColorRange::Hdr, 100.0), limit);
        assert_eq!(color_backward(ColorRange::Hdr, 100.0, -1.0), 0.0);
        assert_eq!(color_backward(ColorRange::Hdr, 100.0, 2.0), 2.0 * limit);
    }

    #[test]
    fn extremes_stay_finite() {
        for range in [ColorRange::Ldr, ColorRange::Hdr] {
            for raw in [-1e30, -1e3, 0.0, 1e3, 1e30] {
                assert!(color(range, raw).is_finite());
                assert!(color_backward(range, raw, 1.0).is_finite());
            }
        }
    }
}
