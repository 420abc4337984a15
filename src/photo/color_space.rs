//! From a field's colours to pictures: display-referred over a background, scene-linear, and depth as grey.
//!
//! A rendered colour is premultiplied by its opacity and in the field's colour space: sRGB for fields of 8-bit
//! images, linear light for fields of HDR images.

use super::image::{Image, Pixels};

/// Opacities below this leave no colour to speak of.
const LEAST_OPACITY: f32 = 1e-6;

/// The colour space that a field was trained in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorSpace {
    /// Display-referred.
    Srgb,
    /// Linear light.
    Linear,
}

impl ColorSpace {
    /// The colour space of a field of HDR images, or of others.
    #[must_use]
    pub fn of(hdr: bool) -> Self {
        if hdr { Self::Linear } else { Self::Srgb }
    }

    /// Display-referred colours in `[0, 1]` of a rendered view over a display-referred `background`.
    #[must_use]
    pub fn over(self, view: &[[f32; 4]], background: [f32; 3]) -> Vec<[f32; 3]> {
        let background = match self {
            Self::Srgb => background,
            Self::Linear => background.map(linear_from_srgb),
        };
        let composite = |&[r, g, b, alpha]: &[f32; 4]| {
            let mut color = [r, g, b];
            for (value, behind) in color.iter_mut().zip(background) {
                *value = self.display(*value + (1.0 - alpha) * behind);
            }
            color
        };
        view.iter().map(composite).collect()
    }

    /// 8-bit sRGB with straight alpha.
    #[must_use]
    pub fn straight_srgb8(self, view: &[[f32; 4]]) -> Vec<[u8; 4]> {
        let pixel = |&[r, g, b, alpha]: &[f32; 4]| {
            let [r, g, b] = [r, g, b].map(|value| quantised(self.display(value / alpha.max(LEAST_OPACITY))));
            [r, g, b, quantised(alpha)]
        };
        view.iter().map(pixel).collect()
    }

    /// Scene-linear colour premultiplied by opacity: `linear(R / α) α`.
    #[must_use]
    pub fn linear(self, view: &[[f32; 4]]) -> Vec<[f32; 4]> {
        let pixel = |&[r, g, b, alpha]: &[f32; 4]| {
            let decode = |value: f32| match self {
                Self::Srgb if alpha > LEAST_OPACITY => linear_from_srgb(value / alpha) * alpha,
                Self::Srgb => 0.0,
                Self::Linear => value,
            };
            [decode(r), decode(g), decode(b), alpha]
        };
        view.iter().map(pixel).collect()
    }

    fn display(self, value: f32) -> f32 {
        let value = value.clamp(0.0, 1.0);
        match self {
            Self::Srgb => value,
            Self::Linear => srgb_from_linear(value),
        }
    }
}

/// The display-referred colours in `[0, 1]` of a photo over a display-referred `background`: images in 8
/// or 16 bits are composited as they are encoded, linear ones in linear light.
#[must_use]
pub fn photo_over(image: &Image, background: [f32; 3]) -> Vec<[f32; 3]> {
    match &image.pixels {
        Pixels::Srgb8(pixels) => ColorSpace::Srgb.over(&premultiplied(pixels, 255.0), background),
        Pixels::Srgb16(pixels) => ColorSpace::Srgb.over(&premultiplied(pixels, 65535.0), background),
        Pixels::Linear(pixels) => ColorSpace::Linear.over(pixels, background),
    }
}

/// Pixels with straight alpha whose whole numbers mean parts of `one`.
fn premultiplied<T: Copy + Into<f32>>(pixels: &[[T; 4]], one: f32) -> Vec<[f32; 4]> {
    let pixel = |&[r, g, b, a]: &[T; 4]| {
        let alpha = a.into() / one;
        let [r, g, b] = [r, g, b].map(|value| value.into() / one * alpha);
        [r, g, b, alpha]
    };
    pixels.iter().map(pixel).collect()
}

/// Opaque 8-bit pixels of display-referred colours in `[0, 1]`.
#[must_use]
pub fn opaque_srgb8(colors: &[[f32; 3]]) -> Vec<[u8; 4]> {
    let pixel = |color: &[f32; 3]| {
        let [r, g, b] = color.map(quantised);
        [r, g, b, 255]
    };
    colors.iter().map(pixel).collect()
}

/// Depth as grey, white at `near` and black at `far`, as transparent as the `view` is.
#[must_use]
pub fn depth_srgb8(depth: &[f32], view: &[[f32; 4]], [near, far]: [f32; 2]) -> Vec<[u8; 4]> {
    let pixel = |(&z, color): (&f32, &[f32; 4])| {
        let grey = quantised((far - z) / (far - near).max(f32::MIN_POSITIVE));
        if z > 0.0 { [grey, grey, grey, quantised(color[3])] } else { [0; 4] }
    };
    depth.iter().zip(view).map(pixel).collect()
}

/// The 8 bits of a display-referred value in `[0, 1]`.
pub(crate) fn quantised(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// The sRGB transfer function: linear light to display-referred, continued below 0 as a line.
pub fn srgb_from_linear(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The inverse of [`srgb_from_linear`].
pub fn linear_from_srgb(srgb: f32) -> f32 {
    if srgb <= 0.040_45 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HALF: [[f32; 4]; 1] = [[0.25, 0.1, 0.0, 0.5]];

    #[test]
    fn backgrounds_fill_what_the_opacity_leaves() {
        assert_eq!(ColorSpace::Srgb.over(&HALF, [0.0; 3]), [[0.25, 0.1, 0.0]]);
        assert_eq!(ColorSpace::Srgb.over(&HALF, [1.0; 3]), [[0.75, 0.6, 0.5]]);
        let [linear] = ColorSpace::Linear.over(&HALF, [1.0; 3])[..] else { panic!("one pixel") };
        assert!((linear[2] - srgb_from_linear(0.5)).abs() < 1e-6);
        let [clipped] = ColorSpace::Linear.over(&[[7.0, -1.0, 1.0, 1.0]], [0.0; 3])[..] else {
            panic!("one pixel")
        };
        assert!((clipped[0] - 1.0).abs() < 1e-6 && clipped[1] == 0.0);
    }

    #[test]
    fn straight_pixels_are_divided_by_the_opacity() {
        assert_eq!(ColorSpace::Srgb.straight_srgb8(&HALF), [[128, 51, 0, 128]]);
        assert_eq!(ColorSpace::Srgb.straight_srgb8(&[[0.0; 4]]), [[0; 4]]);
    }

    #[test]
    fn linear_pixels_are_decoded_before_they_are_multiplied() {
        let [pixel] = ColorSpace::Srgb.linear(&HALF)[..] else { panic!("one pixel") };
        assert!((pixel[0] - 0.214_041 * 0.5).abs() < 1e-6);
        assert_eq!(pixel[3], 0.5);
        assert_eq!(ColorSpace::Linear.linear(&HALF), HALF);
        assert_eq!(ColorSpace::Srgb.linear(&[[0.0; 4]]), [[0.0; 4]]);
    }

    #[test]
    fn a_photo_is_composited_as_it_is_encoded() {
        let pixels = Pixels::Srgb8(vec![[255, 0, 51, 51]]);
        let image = Image { width: 1, height: 1, pixels, has_alpha: true };
        let [white] = photo_over(&image, [1.0; 3])[..] else { panic!("one pixel") };
        for (got, want) in white.into_iter().zip([1.0, 0.8, 0.84]) {
            assert!((got - want).abs() < 1e-6, "{got} {want}");
        }
    }

    #[test]
    fn depth_is_white_when_near() {
        let view = [1.0, 1.0, 1.0, 1.0, 0.4].map(|alpha| [0.0, 0.0, 0.0, alpha]);
        let grey = depth_srgb8(&[0.0, 1.0, 2.0, 3.0, 9.0], &view, [1.0, 3.0]);
        assert_eq!(grey, [[0; 4], [255; 4], [128, 128, 128, 255], [0, 0, 0, 255], [0, 0, 0, 102]]);
    }

    #[test]
    fn srgb_and_linear_are_inverse() {
        for i in 0..=1000 {
            let value = i as f32 / 1000.0;
            assert!((linear_from_srgb(srgb_from_linear(value)) - value).abs() < 2e-6);
        }
        assert!((linear_from_srgb(0.5) - 0.214_041).abs() < 1e-6);
    }
}
