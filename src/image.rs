//! Images in memory and on disk: 8-bit sRGB (PNG, JPEG) and scene-linear (OpenEXR).

mod open_exr;

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use ::image::codecs::png::PngEncoder;
use ::image::{ExtendedColorType, ImageDecoder, ImageEncoder, ImageFormat, ImageReader};
use anyhow::{Context, Result, bail, ensure};

use crate::file::write_atomically;
pub use open_exr::{ExrPixels, Precision, read_exr_channel, write_exr};

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
    /// sRGB-encoded colour with straight alpha.
    Srgb8(Vec<[u8; 4]>),
    /// The same with 16 bits.
    Srgb16(Vec<[u16; 4]>),
    /// Scene-linear colour, premultiplied with alpha. Always finite, alpha in `[0, 1]`.
    Linear(Vec<[f32; 4]>),
}

/// What an image file says about itself before its pixels are decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Whether there is an alpha channel.
    pub has_alpha: bool,
    /// Whether the file is scene-linear (OpenEXR).
    pub is_hdr: bool,
}

impl Image {
    /// Decodes a PNG, JPEG or OpenEXR file; the type is told by content, not by extension.
    pub fn load(path: &Path) -> Result<Self> {
        let load = || match Kind::detect(path)? {
            Kind::OpenExr => open_exr::load(path),
            Kind::Srgb(format) => Self::load_srgb(path, format),
        };
        load().with_context(|| format!("reading {}", path.display()))
    }

    /// Whether the pixels are scene-linear.
    pub fn is_hdr(&self) -> bool {
        matches!(self.pixels, Pixels::Linear(_))
    }

    /// Whether any pixel lets the background through.
    pub fn is_cutout(&self) -> bool {
        match &self.pixels {
            Pixels::Srgb8(pixels) => pixels.iter().any(|pixel| pixel[3] < 255),
            Pixels::Srgb16(pixels) => pixels.iter().any(|pixel| pixel[3] < 65_535),
            Pixels::Linear(pixels) => pixels.iter().any(|pixel| pixel[3] < 0.999),
        }
    }

    /// Geometric mean of the brightest channel over the pixels that are not black or transparent; `None` where all are.
    pub fn brightness(&self) -> Option<f64> {
        let Pixels::Linear(pixels) = &self.pixels else { return Some(1.0) };
        let brightest = pixels.iter().map(|&[r, g, b, alpha]| (r.max(g).max(b), alpha));
        let lit = brightest.filter(|(value, alpha)| *value > 0.0 && *alpha > 0.5);
        let logs: Vec<f64> = lit.map(|(value, alpha)| f64::from(value / alpha).ln()).collect();
        (!logs.is_empty()).then(|| (logs.iter().sum::<f64>() / logs.len() as f64).exp())
    }

    fn load_srgb(path: &Path, format: ImageFormat) -> Result<Self> {
        let decoded = open_srgb(path, format)?.decode()?;
        let has_alpha = decoded.color().has_alpha();
        let rgba = decoded.into_rgba8();
        Ok(Self {
            width: rgba.width(),
            height: rgba.height(),
            pixels: Pixels::Srgb8(rgba.as_raw().as_chunks().0.to_vec()),
            has_alpha,
        })
    }
}

impl Header {
    /// Reads the header of a PNG, JPEG or OpenEXR file.
    pub fn read(path: &Path) -> Result<Self> {
        let read = || match Kind::detect(path)? {
            Kind::OpenExr => open_exr::header(path),
            Kind::Srgb(format) => {
                let decoder = open_srgb(path, format)?.into_decoder()?;
                let (width, height) = decoder.dimensions();
                Ok(Self { width, height, has_alpha: decoder.color_type().has_alpha(), is_hdr: false })
            }
        };
        read().with_context(|| format!("reading {}", path.display()))
    }
}

enum Kind {
    Srgb(ImageFormat),
    OpenExr,
}

impl Kind {
    fn detect(path: &Path) -> Result<Self> {
        let mut magic = Vec::new();
        File::open(path)?.take(32).read_to_end(&mut magic)?;
        match ::image::guess_format(&magic) {
            Ok(format @ (ImageFormat::Png | ImageFormat::Jpeg)) => Ok(Self::Srgb(format)),
            Ok(ImageFormat::OpenExr) => Ok(Self::OpenExr),
            Ok(other) => bail!("expected PNG, JPEG or OpenEXR, found {other:?}; convert the image"),
            Err(_) => bail!(
                "expected PNG, JPEG or OpenEXR, found {} bytes that are none of them",
                std::fs::metadata(path)?.len()
            ),
        }
    }
}

fn open_srgb(path: &Path, format: ImageFormat) -> Result<ImageReader<BufReader<File>>> {
    Ok(ImageReader::with_format(BufReader::new(File::open(path)?), format))
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
    fn sixteen_bits_and_grey_become_eight_bit_colour() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("deep.png");
        let deep = ImageBuffer::from_pixel(3, 1, Rgb([65535u16, 32896, 0]));
        let save = |image: DynamicImage| image.save(&path).expect("writable");
        save(DynamicImage::ImageRgb16(deep));
        let image = Image::load(&path).expect("readable");
        assert_eq!(image.pixels, Pixels::Srgb8(vec![[255, 128, 0, 255]; 3]));
        assert!(!image.has_alpha);
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
