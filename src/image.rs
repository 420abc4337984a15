//! Images in memory and on disk: display-referred (sRGB) in 8 or 16 bits, and scene-linear.

mod alpha;
mod decode;
mod depth;
mod grid;
mod jpeg;
mod open_exr;
mod reduce;

use std::path::Path;

use ::image::codecs::png::PngEncoder;
use ::image::metadata::Orientation;
use ::image::{ExtendedColorType, ImageEncoder};
use anyhow::{Context, Result, ensure};

use crate::file::write_atomically;
pub(crate) use alpha::{Evidence, Multiplied};
use decode::Kind;
pub use depth::{DepthMap, load_depth};
pub use grid::{Turn, Window};
pub(crate) use grid::{crop, nearest};
pub use open_exr::{ExrPixels, Precision, read_exr_channel, write_exr};
pub(crate) use reduce::{reduce_any, reduce_depth};

/// The formats that [`Image::load`] reads, for messages.
pub const FORMATS: &str = "PNG, JPEG, WebP, TIFF, BMP, OpenEXR or Radiance HDR";

/// Most pixels of an image: more are a damaged header or a trap rather than a photo.
pub const MOST_PIXELS: u64 = 1 << 28;
/// Most pixels along one side of an image.
pub const LONGEST_SIDE: u32 = 1 << 16;

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

/// What an image file says about itself before its pixels are decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Width in pixels, as stored.
    pub width: u32,
    /// Height in pixels, as stored.
    pub height: u32,
    /// Whether there is an alpha channel.
    pub has_alpha: bool,
    /// How finely pixels are stored.
    pub bits: BitDepth,
    /// How a viewer should turn the picture, by its metadata (EXIF or the like); `None` for as it is stored.
    /// [`Image::load`] does not turn.
    pub orientation: Option<Orientation>,
}

impl Image {
    /// Decodes a file of any of the [`FORMATS`], told by content and not by extension, as it is stored: colour
    /// and alpha are taken for straight in display-referred files and for premultiplied in linear ones, and the
    /// orientation in the metadata is not applied.
    ///
    /// # Errors
    /// When the file cannot be read, is damaged, incomplete or of another format, or has more than
    /// [`MOST_PIXELS`]; the message names the file.
    pub fn load(path: &Path) -> Result<Self> {
        let load = || match Kind::detect(path)? {
            Kind::OpenExr => open_exr::load(path),
            Kind::Common(format) => decode::load(path, format),
        };
        of_file(path, load)
    }

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

    /// The picture turned as [`Turn`] says.
    pub(crate) fn turned(self, turn: Turn) -> Self {
        let size = self.size();
        let [width, height] = turn.size(size);
        let pixels = match self.pixels {
            Pixels::Srgb8(pixels) => Pixels::Srgb8(turn.apply(&pixels, size)),
            Pixels::Srgb16(pixels) => Pixels::Srgb16(turn.apply(&pixels, size)),
            Pixels::Linear(pixels) => Pixels::Linear(turn.apply(&pixels, size)),
        };
        Self { width, height, pixels, ..self }
    }

    /// The part of the picture inside `window`, which lies within it.
    pub(crate) fn cropped(self, window: Window) -> Self {
        let own = self.size();
        if own == window.size {
            return self;
        }
        let pixels = match self.pixels {
            Pixels::Srgb8(pixels) => Pixels::Srgb8(crop(&pixels, own, window)),
            Pixels::Srgb16(pixels) => Pixels::Srgb16(crop(&pixels, own, window)),
            Pixels::Linear(pixels) => Pixels::Linear(crop(&pixels, own, window)),
        };
        let [width, height] = window.size;
        Self { width, height, pixels, ..self }
    }

    /// The pixels at `size`, which is at most as large: each is the mean of the area it covers.
    pub(crate) fn reduced(self, size: [u32; 2]) -> Self {
        let pixels = reduce::reduce(&self.pixels, self.size(), size);
        let [width, height] = size;
        Self { width, height, pixels, ..self }
    }

    /// 8-bit pixels in 16 bits; others as they are.
    pub(crate) fn in_16_bits(self) -> Self {
        let Pixels::Srgb8(pixels) = self.pixels else { return self };
        let pixels = pixels.iter().map(|pixel| pixel.map(|value| u16::from(value) * 257)).collect();
        Self { pixels: Pixels::Srgb16(pixels), ..self }
    }
}

impl Pixels {
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

impl Header {
    /// Reads the header of a file of any of the [`FORMATS`].
    ///
    /// # Errors
    /// As [`Image::load`].
    pub fn read(path: &Path) -> Result<Self> {
        let read = || match Kind::detect(path)? {
            Kind::OpenExr => open_exr::header(path),
            Kind::Common(format) => decode::header(path, format),
        };
        of_file(path, read)
    }
}

/// What `read` makes of a file; errors name the file.
fn of_file<T>(path: &Path, read: impl FnOnce() -> Result<T>) -> Result<T> {
    read().with_context(|| format!("reading {}", path.display()))
}

/// Refuses sizes that no photo has, before memory is asked for them.
fn check_size(width: u64, height: u64) -> Result<()> {
    let longest = u64::from(LONGEST_SIDE);
    ensure!(
        (1..=longest).contains(&width) && (1..=longest).contains(&height) && width * height <= MOST_PIXELS,
        "expected an image of 1 to {LONGEST_SIDE} pixels a side and at most {} megapixels, found {width}x{height}; \
         reduce it, or export it again if it is damaged",
        MOST_PIXELS / 1_000_000
    );
    Ok(())
}

/// Writes an 8-bit PNG: sRGB-encoded colour with straight alpha, `[height * width]`.
pub fn write_png_rgba8(path: &Path, width: u32, height: u32, pixels: &[[u8; 4]]) -> Result<()> {
    check_count(width, height, pixels.len())?;
    write_atomically(path, |writer| {
        let encoder = PngEncoder::new(writer);
        Ok(encoder.write_image(pixels.as_flattened(), width, height, ExtendedColorType::Rgba8)?)
    })
}

fn check_count(width: u32, height: u32, count: usize) -> Result<()> {
    ensure!(
        count as u64 == u64::from(width) * u64::from(height) && count > 0,
        "an image of {width}x{height} needs as many pixels, found {count}"
    );
    Ok(())
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
    use ::image::{DynamicImage, ImageBuffer, Luma, Rgb};

    #[test]
    fn png_round_trip_ignores_the_extension() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("picture.jpg");
        let pixels = vec![[1, 2, 3, 4], [250, 0, 128, 255], [0; 4], [9, 8, 7, 0]];
        write_png_rgba8(&path, 2, 2, &pixels).expect("writable");
        let image = Image::load(&path).expect("readable");
        assert_eq!((image.width, image.height), (2, 2));
        assert!(image.has_alpha && image.is_cutout() && !image.is_hdr());
        assert_eq!(image.pixels, Pixels::Srgb8(pixels));
        assert!(write_png_rgba8(&path, 3, 2, &[[0; 4]]).is_err());
    }

    #[test]
    fn sixteen_bits_stay_and_grey_becomes_colour() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("deep.png");
        let deep = ImageBuffer::from_pixel(3, 1, Rgb([65535u16, 32896, 0]));
        let save = |image: DynamicImage| image.save(&path).expect("writable");
        save(DynamicImage::ImageRgb16(deep));
        let image = Image::load(&path).expect("readable");
        assert_eq!(image.pixels, Pixels::Srgb16(vec![[65535, 32896, 0, 65535]; 3]));
        assert!(!image.has_alpha);
        assert_eq!(Pixels::to_srgb8(&[[65535, 32896, 128, 129]]), [[255, 128, 0, 1]]);
        save(DynamicImage::ImageLuma8(ImageBuffer::from_pixel(1, 1, Luma([77]))));
        let grey = Image::load(&path).expect("readable");
        assert_eq!(grey.pixels, Pixels::Srgb8(vec![[77, 77, 77, 255]]));
    }

    #[test]
    fn other_files_are_refused_by_name_and_type() {
        let folder = tempfile::tempdir().expect("temporary folder");
        for (bytes, expected) in [(&b"GIF89a......"[..], "found Gif"), (b"", "found 0 bytes")] {
            let path = folder.path().join("photo.png");
            std::fs::write(&path, bytes).expect("writable");
            let message = format!("{:#}", Image::load(&path).expect_err("refused"));
            assert!(message.contains("photo.png") && message.contains(expected), "{message}");
            assert!(Header::read(&path).is_err());
        }
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
