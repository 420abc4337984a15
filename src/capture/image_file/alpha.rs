//! Straight and premultiplied alpha.

use crate::photo::{Image, Pixels};

/// What the colours of a file with alpha were multiplied with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Multiplied {
    /// Nothing.
    Straight,
    /// Alpha.
    Premultiplied,
}

/// What the pixels of some images say about how they were multiplied.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Evidence {
    /// Pixels that are not opaque.
    pub(crate) transparent: u64,
    /// Of those, pixels with a colour above their alpha, which premultiplied colours never have.
    pub(crate) above: u64,
    /// Of those, pixels whose colour would be above their alpha if it were straight and like that of the opaque
    /// pixels.
    pub(crate) expected_above: u64,
}

impl Evidence {
    /// Fewer telling pixels than this tell nothing.
    const LEAST: u64 = 16;

    /// Whether the colours are premultiplied, as far as one can tell: none is above its alpha, though colours
    /// as bright as the opaque ones would be. Lossy compression lets one in a thousand slip.
    pub(crate) fn is_premultiplied(self) -> bool {
        self.expected_above >= Self::LEAST && self.above * 1000 <= self.transparent
    }

    pub(crate) fn and(self, other: Self) -> Self {
        Self {
            transparent: self.transparent + other.transparent,
            above: self.above + other.above,
            expected_above: self.expected_above + other.expected_above,
        }
    }
}

impl Image {
    /// The same image with the colours as [`Pixels`] wants them, from a file that has them otherwise.
    pub(crate) fn reinterpreted(mut self, as_stored: Multiplied) -> Self {
        match (&mut self.pixels, as_stored) {
            (Pixels::Srgb8(pixels), Multiplied::Premultiplied) => pixels.iter_mut().for_each(divide),
            (Pixels::Srgb16(pixels), Multiplied::Premultiplied) => pixels.iter_mut().for_each(divide),
            (Pixels::Linear(pixels), Multiplied::Straight) => pixels.iter_mut().for_each(multiply),
            _ => {}
        }
        self
    }

    /// What display-referred pixels show; nothing for linear ones.
    pub(crate) fn evidence(&self) -> Evidence {
        match &self.pixels {
            Pixels::Srgb8(pixels) => evidence(pixels, u8::MAX),
            Pixels::Srgb16(pixels) => evidence(pixels, u16::MAX),
            Pixels::Linear(_) => Evidence::default(),
        }
    }

    /// The same image with this alpha, `[height * width]`, 65535 is 1; the colours are straight.
    pub(crate) fn with_alpha(mut self, alpha: &[u16]) -> Self {
        match &mut self.pixels {
            Pixels::Srgb8(pixels) => {
                for (pixel, &alpha) in pixels.iter_mut().zip(alpha) {
                    pixel[3] = ((u32::from(alpha) + 128) / 257) as u8;
                }
            }
            Pixels::Srgb16(pixels) => {
                for (pixel, &alpha) in pixels.iter_mut().zip(alpha) {
                    pixel[3] = alpha;
                }
            }
            Pixels::Linear(pixels) => {
                for (pixel, &alpha) in pixels.iter_mut().zip(alpha) {
                    pixel[3] = f32::from(alpha) / 65535.0;
                    multiply(pixel);
                }
            }
        }
        self.has_alpha = true;
        self
    }

    /// The brightest of red, green and blue per pixel, `[height * width]`, 65535 is 1.
    pub(crate) fn brightness(&self) -> Vec<u16> {
        let greatest = |r: u16, g: u16, b: u16| r.max(g).max(b);
        match &self.pixels {
            Pixels::Srgb8(pixels) => {
                pixels.iter().map(|&[r, g, b, _]| u16::from(r.max(g).max(b)) * 257).collect()
            }
            Pixels::Srgb16(pixels) => pixels.iter().map(|&[r, g, b, _]| greatest(r, g, b)).collect(),
            Pixels::Linear(pixels) => {
                let whole = |value: f32| (value.clamp(0.0, 1.0) * 65535.0).ceil() as u16;
                pixels.iter().map(|&[r, g, b, _]| greatest(whole(r), whole(g), whole(b))).collect()
            }
        }
    }

    /// The alpha channel, `[height * width]`, 65535 is 1.
    pub(crate) fn alpha(&self) -> Vec<u16> {
        match &self.pixels {
            Pixels::Srgb8(pixels) => pixels.iter().map(|pixel| u16::from(pixel[3]) * 257).collect(),
            Pixels::Srgb16(pixels) => pixels.iter().map(|pixel| pixel[3]).collect(),
            Pixels::Linear(pixels) => {
                pixels.iter().map(|pixel| (pixel[3].clamp(0.0, 1.0) * 65535.0).ceil() as u16).collect()
            }
        }
    }

    /// The red channel, `[height * width]`, 65535 is 1.
    pub(crate) fn red(&self) -> Vec<u16> {
        match &self.pixels {
            Pixels::Srgb8(pixels) => pixels.iter().map(|pixel| u16::from(pixel[0]) * 257).collect(),
            Pixels::Srgb16(pixels) => pixels.iter().map(|pixel| pixel[0]).collect(),
            Pixels::Linear(pixels) => {
                pixels.iter().map(|pixel| (pixel[0].clamp(0.0, 1.0) * 65535.0 + 0.5) as u16).collect()
            }
        }
    }
}

/// A whole number that stands for a part of 1.
trait Part: Copy + Ord + Into<u32> + TryFrom<u32> {
    const ONE: Self;
}

impl Part for u8 {
    const ONE: Self = Self::MAX;
}

impl Part for u16 {
    const ONE: Self = Self::MAX;
}

/// From premultiplied to straight, rounded; colours above alpha become 1, and what has no alpha has no colour.
fn divide<T: Part>(pixel: &mut [T; 4]) {
    let alpha: u32 = pixel[3].into();
    let one: u32 = T::ONE.into();
    for value in &mut pixel[..3] {
        let color: u32 = (*value).into();
        let straight = (color * one + alpha / 2).checked_div(alpha).unwrap_or(0);
        *value = T::try_from(straight).unwrap_or(T::ONE);
    }
}

fn multiply(pixel: &mut [f32; 4]) {
    let alpha = pixel[3];
    pixel[..3].iter_mut().for_each(|value| *value *= alpha);
}

fn evidence<T: Part>(pixels: &[[T; 4]], one: T) -> Evidence {
    let greatest = |pixel: &[T; 4]| pixel[0].max(pixel[1]).max(pixel[2]);
    let mut opaque: Vec<T> = pixels.iter().filter(|pixel| pixel[3] == one).map(greatest).collect();
    if opaque.is_empty() {
        return Evidence::default();
    }
    let middle = opaque.len() / 2;
    let (_, &mut typical, _) = opaque.select_nth_unstable(middle);
    let one_percent = one.into() / 100;
    let mut found = Evidence::default();
    for pixel in pixels.iter().filter(|pixel| pixel[3] < one) {
        found.transparent += 1;
        // Rounding and resampling may leave premultiplied colours a step above.
        let above = greatest(pixel).into() > pixel[3].into() + one_percent;
        found.above += u64::from(above);
        let is_partial = pixel[3].into() > 0;
        let would_be = typical.into() > pixel[3].into() + 2 * one_percent;
        found.expected_above += u64::from(is_partial && would_be);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn divided_colours_are_exact_within_rounding() {
        for alpha in 1..=255_u32 {
            for color in (0..=255_u32).step_by(15) {
                let product = ((color * alpha + 127) / 255) as u8;
                let mut pixel = [product, 0, 255, alpha as u8];
                divide(&mut pixel);
                let error = u32::from(pixel[0]).abs_diff(color);
                assert!(error * 2 * alpha <= 255 + 2 * alpha, "{color} {alpha} {pixel:?}");
                assert_eq!((pixel[1], pixel[2], u32::from(pixel[3])), (0, 255, alpha));
            }
        }
        let mut deep = [30000_u16, 65535, 1, 60000];
        divide(&mut deep);
        assert_eq!(deep, [32768, 65535, 1, 60000]);
        let mut clear = [3_u8, 2, 1, 0];
        divide(&mut clear);
        assert_eq!(clear, [0; 4]);
    }
}
