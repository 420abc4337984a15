//! Pixels as plain values: display-referred (sRGB) in 8 or 16 bits, and scene-linear.

/// A decoded image.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The pixels, row by row from the top-left corner, `[height * width]`.
    pub pixels: Pixels,
    /// Whether the file has an alpha channel; without one, alpha is 1 everywhere.
    pub has_alpha: bool,
}

/// Pixel data, red green blue alpha.
#[derive(Clone, Debug, PartialEq)]
pub enum Pixels {
    /// sRGB-encoded colour with straight alpha, 255 is 1.
    Srgb8(Vec<[u8; 4]>),
    /// sRGB-encoded colour with straight alpha, 65535 is 1.
    Srgb16(Vec<[u16; 4]>),
    /// Scene-linear colour, premultiplied with alpha. Always finite, alpha in `[0, 1]`.
    Linear(Vec<[f32; 4]>),
}

/// How finely pixels are stored; the finer, the greater.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum BitDepth {
    /// 8 bits a channel, sRGB-encoded.
    Eight,
    /// 16 bits a channel, sRGB-encoded.
    Sixteen,
    /// Scene-linear numbers (OpenEXR, Radiance HDR, TIFF with floats).
    Float,
}

impl Image {
    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Whether the pixels are scene-linear.
    pub fn is_hdr(&self) -> bool {
        matches!(self.pixels, Pixels::Linear(_))
    }

    /// Whether any pixel lets the background through.
    pub fn is_cutout(&self) -> bool {
        match &self.pixels {
            Pixels::Srgb8(pixels) => pixels.iter().any(|pixel| pixel[3] < u8::MAX),
            Pixels::Srgb16(pixels) => pixels.iter().any(|pixel| pixel[3] < u16::MAX),
            Pixels::Linear(pixels) => pixels.iter().any(|pixel| pixel[3] < 0.999),
        }
    }

    /// Geometric mean of the brightest channel over the pixels that are not black or transparent; `None` where all are.
    pub fn grey(&self) -> Option<f64> {
        let Pixels::Linear(pixels) = &self.pixels else { return Some(1.0) };
        let brightest = pixels.iter().map(|&[r, g, b, alpha]| (r.max(g).max(b), alpha));
        let lit = brightest.filter(|(value, alpha)| *value > 0.0 && *alpha > 0.5);
        let logs: Vec<f64> = lit.map(|(value, alpha)| f64::from(value / alpha).ln()).collect();
        (!logs.is_empty()).then(|| (logs.iter().sum::<f64>() / logs.len() as f64).exp())
    }
}

impl Pixels {
    /// Number of pixels.
    pub fn count(&self) -> usize {
        match self {
            Self::Srgb8(pixels) => pixels.len(),
            Self::Srgb16(pixels) => pixels.len(),
            Self::Linear(pixels) => pixels.len(),
        }
    }

    /// How finely they are stored.
    pub fn bits(&self) -> BitDepth {
        match self {
            Self::Srgb8(_) => BitDepth::Eight,
            Self::Srgb16(_) => BitDepth::Sixteen,
            Self::Linear(_) => BitDepth::Float,
        }
    }

    /// The same at 8 bits where they have 16: `round(v / 257)`.
    pub fn to_srgb8(pixels: &[[u16; 4]]) -> Vec<[u8; 4]> {
        let narrow = |value: u16| ((u32::from(value) + 128) / 257) as u8;
        pixels.iter().map(|pixel| pixel.map(narrow)).collect()
    }
}

impl BitDepth {
    /// Bytes per pixel that decoding takes at its peak, the decoded pixels included. The most that any of the
    /// formats takes: 8-bit progressive JPEG keeps all coefficients (6) and its colours (3), TIFF hands over its
    /// own copy of everything.
    pub fn decoding_bytes_per_pixel(self) -> u64 {
        match self {
            Self::Eight => 14,
            Self::Sixteen => 24,
            Self::Float => 44,
        }
    }
}
