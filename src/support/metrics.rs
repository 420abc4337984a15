//! Image quality: mean squared error, PSNR and SSIM of a prediction against a target.
//!
//! Colours are display-referred with a data range of 1. Images are row-major, `[height * width]`
//! pixels of three channels. Predictions are clamped to `[0, 1]` (NaN counts as 0) and not quantised.

use std::borrow::Cow;

use rayon::prelude::*;

/// The PSNR, in decibels, at which [`psnr`] saturates; identical images would otherwise give infinity,
/// which JSON cannot hold.
pub const PSNR_CAP_DB: f64 = 100.0;

/// Largest window of [`ssim`], in pixels per axis.
const SSIM_WINDOW: usize = 11;
/// Standard deviation of the window of [`ssim`], in pixels.
const SSIM_SIGMA: f64 = 1.5;
/// `(K1 L)²` with K1 = 0.01 and the data range L = 1.
const SSIM_C1: f64 = 0.01 * 0.01;
/// `(K2 L)²` with K2 = 0.03 and the data range L = 1.
const SSIM_C2: f64 = 0.03 * 0.03;

/// Mean squared error over all pixels and channels; 0 for images without pixels.
///
/// # Panics
/// If the images differ in their number of pixels.
pub fn mse(prediction: &[[f32; 3]], target: &[[f32; 3]]) -> f64 {
    assert_eq!(prediction.len(), target.len(), "images of one size");
    if prediction.is_empty() {
        return 0.0;
    }
    let predicted = prediction.as_flattened().iter();
    let total: f64 =
        predicted.zip(target.as_flattened()).map(|(&p, &t)| (clamp(p) - f64::from(t)).powi(2)).sum();
    total / (3 * prediction.len()) as f64
}

/// Peak signal-to-noise ratio `-10 log10(mse)` in decibels, at most [`PSNR_CAP_DB`].
///
/// # Panics
/// If the images differ in their number of pixels.
pub fn psnr(prediction: &[[f32; 3]], target: &[[f32; 3]]) -> f64 {
    (-10.0 * mse(prediction, target).log10()).min(PSNR_CAP_DB)
}

/// The PSNR over the pixels that are not `ignored`; over all where `ignored` is empty. [`PSNR_CAP_DB`] where none
/// is left.
///
/// # Panics
/// If the images, or the flags of some, differ in their number of pixels.
pub fn psnr_where(prediction: &[[f32; 3]], target: &[[f32; 3]], ignored: &[bool]) -> f64 {
    if ignored.is_empty() {
        return psnr(prediction, target);
    }
    psnr(&kept(prediction, ignored), &kept(target, ignored))
}

/// The prediction with the target's colours where the pixel is `ignored`, so that nothing differs there; as it
/// is where `ignored` is empty.
///
/// # Panics
/// If the images, or the flags of some, differ in their number of pixels.
pub fn filled<'a>(prediction: &'a [[f32; 3]], target: &[[f32; 3]], ignored: &[bool]) -> Cow<'a, [[f32; 3]]> {
    if ignored.is_empty() {
        return Cow::Borrowed(prediction);
    }
    assert_eq!((prediction.len(), target.len()), (ignored.len(), ignored.len()), "a flag for every pixel");
    let pairs = prediction.iter().zip(target).zip(ignored);
    pairs.map(|((&predicted, &wanted), &ignored)| if ignored { wanted } else { predicted }).collect()
}

fn kept(pixels: &[[f32; 3]], ignored: &[bool]) -> Vec<[f32; 3]> {
    assert_eq!(pixels.len(), ignored.len(), "a flag for every pixel");
    pixels.iter().zip(ignored).filter(|(_, ignored)| !**ignored).map(|(&pixel, _)| pixel).collect()
}

/// Structural similarity (Wang et al. 2004): per channel
/// `(2 μx μy + C1)(2 σxy + C2) / ((μx² + μy² + C1)(σx² + σy² + C2))` under an 11×11 Gaussian window with
/// σ = 1.5, averaged over the windows that lie within the image, then over the channels.
///
/// Along an axis with fewer than 11 pixels the window is the axis itself, with the Gaussian centred on
/// it and renormalised. Images without pixels give 1.
///
/// # Panics
/// If an image does not hold `width * height` pixels.
pub fn ssim(prediction: &[[f32; 3]], target: &[[f32; 3]], width: usize, height: usize) -> f64 {
    assert_eq!(prediction.len(), width * height, "one colour per pixel");
    assert_eq!(target.len(), width * height, "one colour per pixel");
    if prediction.is_empty() {
        return 1.0;
    }
    let (across, down) = (window(width), window(height));
    let columns = width + 1 - across.len();
    let rows = height + 1 - down.len();
    let channel_mean = |channel: usize| {
        let pair = |i: usize| (clamp(prediction[i][channel]), f64::from(target[i][channel]));
        let filtered: Vec<Moments> = (0..columns * height)
            .into_par_iter()
            .map(|i| {
                let start = (i / columns) * width + i % columns;
                weigh(&across, |k| moments(pair(start + k)))
            })
            .collect();
        let row_sums: Vec<f64> = (0..rows)
            .into_par_iter()
            .map(|row| {
                let at = |column: usize, k: usize| filtered[(row + k) * columns + column];
                let windows = (0..columns).map(|column| weigh(&down, |k| at(column, k)));
                windows.map(similarity).sum()
            })
            .collect();
        row_sums.iter().sum::<f64>() / (rows * columns) as f64
    };
    (0..3).map(channel_mean).sum::<f64>() / 3.0
}

/// The weighted means of `x, y, x², y², x y` under a window.
type Moments = [f64; 5];

fn moments((x, y): (f64, f64)) -> Moments {
    [x, y, x * x, y * y, x * y]
}

/// `Σ_k weights[k] value(k)`.
fn weigh(weights: &[f64], value: impl Fn(usize) -> Moments) -> Moments {
    let mut sum = [0.0; 5];
    for (k, weight) in weights.iter().enumerate() {
        let term = value(k);
        for (total, part) in sum.iter_mut().zip(term) {
            *total += weight * part;
        }
    }
    sum
}

fn similarity([x, y, xx, yy, xy]: Moments) -> f64 {
    let luminance = (2.0 * x * y + SSIM_C1) / (x * x + y * y + SSIM_C1);
    let variances = (xx - x * x) + (yy - y * y);
    luminance * (2.0 * (xy - x * y) + SSIM_C2) / (variances + SSIM_C2)
}

/// The normalised Gaussian along an axis of `extent` pixels.
fn window(extent: usize) -> Vec<f64> {
    let size = extent.min(SSIM_WINDOW);
    let center = (size as f64 - 1.0) / 2.0;
    let weight = |i: usize| (-(i as f64 - center).powi(2) / (2.0 * SSIM_SIGMA * SSIM_SIGMA)).exp();
    let total: f64 = (0..size).map(weight).sum();
    (0..size).map(|i| weight(i) / total).collect()
}

/// `value` within `[0, 1]`; NaN becomes 0.
fn clamp(value: f32) -> f64 {
    if value.is_nan() { 0.0 } else { f64::from(value.clamp(0.0, 1.0)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pattern(width: usize, height: usize, seed: usize) -> Vec<[f32; 3]> {
        let value = |i: usize| ((i * 7919 + seed * 104_729) % 1009) as f32 / 1008.0;
        (0..width * height).map(|i| [value(3 * i), value(3 * i + 1), value(3 * i + 2)]).collect()
    }

    /// SSIM written down directly: the two-dimensional window, variances as centred sums.
    fn ssim_brute_force(x: &[[f32; 3]], y: &[[f32; 3]], width: usize, height: usize) -> f64 {
        let (wx, wy) = (window(width), window(height));
        let (mut total, mut count) = (0.0, 0.0);
        for channel in 0..3 {
            for row in 0..=height - wy.len() {
                for column in 0..=width - wx.len() {
                    let mut taps = Vec::new();
                    for (j, b) in wy.iter().enumerate() {
                        for (i, a) in wx.iter().enumerate() {
                            let k = (row + j) * width + column + i;
                            taps.push((a * b, x[k][channel] as f64, y[k][channel] as f64));
                        }
                    }
                    let mx: f64 = taps.iter().map(|(w, p, _)| w * p).sum();
                    let my: f64 = taps.iter().map(|(w, _, q)| w * q).sum();
                    let vx: f64 = taps.iter().map(|(w, p, _)| w * (p - mx).powi(2)).sum();
                    let vy: f64 = taps.iter().map(|(w, _, q)| w * (q - my).powi(2)).sum();
                    let cov: f64 = taps.iter().map(|(w, p, q)| w * (p - mx) * (q - my)).sum();
                    total += (2.0 * mx * my + 1e-4) * (2.0 * cov + 9e-4)
                        / ((mx * mx + my * my + 1e-4) * (vx + vy + 9e-4));
                    count += 1.0;
                }
            }
        }
        total / count
    }

    #[test]
    fn psnr_of_known_errors() {
        // Errors 0.1 in all channels: mse 0.01, 20 dB.
        let gray = [[0.5; 3]; 4];
        assert!((psnr(&[[0.6; 3]; 4], &gray) - 20.0).abs() < 1e-5);
        // One of six values off by 0.6: mse 0.06, 12.2185 dB.
        let one = [[1.1_f32, 0.4, 0.4], [0.4, 0.4, 0.4]];
        assert!((mse(&one, &[[0.4; 3]; 2]) - 0.06).abs() < 1e-7);
        assert!((psnr(&one, &[[0.4; 3]; 2]) - 12.218_487).abs() < 1e-5);
    }

    #[test]
    fn psnr_saturates_and_stays_finite() {
        let gray = [[0.5; 3]; 4];
        assert_eq!(psnr(&gray, &gray), PSNR_CAP_DB);
        assert_eq!(psnr(&[], &[]), PSNR_CAP_DB);
        assert_eq!(psnr(&[[7.0, -3.0, f32::NAN]], &[[1.0, 0.0, 0.0]]), PSNR_CAP_DB);
        assert_eq!(psnr(&[[0.0; 3]], &[[1.0; 3]]), 0.0);
    }

    #[test]
    fn ignored_pixels_add_no_error() {
        // The second pixel's error of 1 does not count: 20 dB of the first alone.
        let (predicted, gray) = ([[0.6; 3], [1.0; 3]], [[0.5; 3], [0.0; 3]]);
        assert!((psnr_where(&predicted, &gray, &[false, true]) - 20.0).abs() < 1e-5);
        assert_eq!(psnr_where(&predicted, &gray, &[]), psnr(&predicted, &gray));
        assert_eq!(psnr_where(&predicted, &gray, &[true, true]), PSNR_CAP_DB);
        assert_eq!(*filled(&predicted, &gray, &[false, true]), [[0.6; 3], [0.0; 3]]);
        assert_eq!(*filled(&predicted, &gray, &[]), predicted);
        let (x, y) = (pattern(20, 20, 1), pattern(20, 20, 2));
        assert!((ssim(&filled(&x, &y, &[true; 400]), &y, 20, 20) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn ssim_of_identical_images_is_one() {
        let image = pattern(17, 13, 1);
        assert!((ssim(&image, &image, 17, 13) - 1.0).abs() < 1e-12);
        assert_eq!(ssim(&[], &[], 0, 0), 1.0);
    }

    #[test]
    fn ssim_of_flat_images_is_the_luminance_term() {
        // (2·0.5·0.25 + 1e-4) / (0.25 + 0.0625 + 1e-4) = 0.2501 / 0.3126
        let got = ssim(&[[0.5; 3]; 144], &[[0.25; 3]; 144], 12, 12);
        assert!((got - 0.2501 / 0.3126).abs() < 1e-9, "{got}");
    }

    #[test]
    fn ssim_of_two_pixels_by_hand() {
        // Two pixels have equal weights 1/2: x = (0, 1), y = (1, 0): means 1/2, variances 1/4,
        // covariance -1/4: 1 · (-0.5 + 9e-4) / (0.5 + 9e-4).
        let x = [[0.0; 3], [1.0; 3]];
        let y = [[1.0; 3], [0.0; 3]];
        let want = (-0.5 + 9e-4) / (0.5 + 9e-4);
        assert!((ssim(&x, &y, 2, 1) - want).abs() < 1e-12);
    }

    #[test]
    fn ssim_matches_the_brute_force() {
        for (width, height) in [(11, 11), (23, 14), (12, 5), (4, 30), (3, 3), (1, 1)] {
            let (x, y) = (pattern(width, height, 1), pattern(width, height, 2));
            let difference = ssim(&x, &y, width, height) - ssim_brute_force(&x, &y, width, height);
            assert!(difference.abs() < 1e-10, "{width}x{height}: {difference}");
        }
    }
}
