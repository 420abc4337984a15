//! Every format but OpenEXR, through the decoders of the `image` crate.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use ::image::codecs::bmp::BmpDecoder;
use ::image::codecs::hdr::HdrDecoder;
use ::image::codecs::jpeg::JpegDecoder;
use ::image::codecs::png::PngDecoder;
use ::image::codecs::pnm::PnmDecoder;
use ::image::codecs::tga::TgaDecoder;
use ::image::codecs::tiff::TiffDecoder;
use ::image::codecs::webp::WebPDecoder;
use ::image::metadata::Orientation;
use ::image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, Limits};
use anyhow::{Context, Result, bail, ensure};

use super::open_exr::finite;
use super::{FORMATS, Foreign, Header, check_size, jpeg, tga};
use crate::photo::{BitDepth, Image, Pixels};

/// What decoders may ask for beyond the pixels: metadata, colour profiles, lookup tables.
const SPARE_BYTES: u64 = 64 << 20;

/// The kind of file, and with it the decoder that it needs.
pub(super) enum FileFormat {
    /// One of the `image` crate.
    Common(ImageFormat),
    /// That of [`super::open_exr`].
    OpenExr,
}

impl FileFormat {
    pub(super) fn detect(path: &Path) -> Result<Self> {
        ensure!(!path.is_dir(), "expected an image file, found a folder");
        let mut magic = Vec::new();
        File::open(path)?.take(32).read_to_end(&mut magic)?;
        // Radiance's own programs write either name.
        if magic.starts_with(b"#?RGBE") {
            return Ok(Self::Common(ImageFormat::Hdr));
        }
        use ImageFormat::{Bmp, Hdr, Jpeg, OpenExr, Png, Pnm, Tga, Tiff, WebP};
        let guess = ::image::guess_format(&magic);
        if let (Ok(Tiff), Some(raw)) = (&guess, Foreign::raw(path, &magic)) {
            return Err(raw.into());
        }
        match guess {
            Ok(OpenExr) => Ok(Self::OpenExr),
            Ok(format @ (Png | Jpeg | WebP | Tiff | Bmp | Hdr | Pnm)) => Ok(Self::Common(format)),
            _ if tga::is_tga(path, &magic)? => Ok(Self::Common(Tga)),
            _ => Err(Foreign::of(path)?.into()),
        }
    }
}

/// Whether pixels are only about those that were written: in JPEG, and in WebP whose first picture is not lossless.
pub(super) fn is_lossy(path: &Path) -> Result<bool> {
    let mut begin = Vec::new();
    File::open(path)?.take(34).read_to_end(&mut begin)?;
    // The picture's chunk comes first, or after an extended header.
    let is_lossless = [12, 30].iter().any(|&at| begin[at.min(begin.len())..].starts_with(b"VP8L"));
    Ok(match FileFormat::detect(path)? {
        FileFormat::Common(ImageFormat::Jpeg) => true,
        FileFormat::Common(ImageFormat::WebP) => !is_lossless,
        _ => false,
    })
}

pub(super) fn header(path: &Path, format: ImageFormat) -> Result<Header> {
    let mut decoder = open(path, format)?;
    let (width, height) = decoder.dimensions();
    // What is wrong with metadata is no reason to refuse the pixels.
    let orientation = decoder.orientation().unwrap_or(Orientation::NoTransforms);
    let color = decoder.color_type();
    Ok(Header {
        width,
        height,
        has_alpha: color.has_alpha(),
        bits: bits(color),
        orientation: Some(orientation).filter(|orientation| *orientation != Orientation::NoTransforms),
    })
}

pub(super) fn load(path: &Path, format: ImageFormat) -> Result<Image> {
    if format == ImageFormat::Jpeg {
        jpeg::check_complete(path)?;
    }
    let decoder = open(path, format)?;
    let has_alpha = decoder.color_type().has_alpha();
    let decoded = DynamicImage::from_decoder(decoder).context(
        "the file is damaged or incomplete, or uses a rare variant of its format; copy it again, or convert it to PNG",
    )?;
    let (width, height) = (decoded.width(), decoded.height());
    Ok(Image { width, height, pixels: pixels(decoded), has_alpha })
}

fn bits(color: ColorType) -> BitDepth {
    match color {
        ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8 => BitDepth::Eight,
        ColorType::Rgb32F | ColorType::Rgba32F => BitDepth::Float,
        _ => BitDepth::Sixteen,
    }
}

/// A decoder whose image has a size that is worth decoding.
fn open(path: &Path, format: ImageFormat) -> Result<Box<dyn ImageDecoder>> {
    let file = File::open(path)?;
    let length = file.metadata()?.len();
    let reader = BufReader::new(file);
    let spare = |bytes| {
        let mut limits = Limits::default();
        limits.max_alloc = Some(bytes + SPARE_BYTES);
        limits
    };
    let make = || -> Result<Box<dyn ImageDecoder>> {
        Ok(match format {
            ImageFormat::Png => Box::new(PngDecoder::with_limits(reader, spare(0))?),
            ImageFormat::Jpeg => Box::new(JpegDecoder::new(reader)?),
            ImageFormat::WebP => Box::new(WebPDecoder::new(reader)?),
            ImageFormat::Bmp => Box::new(BmpDecoder::new(reader)?),
            ImageFormat::Pnm => Box::new(PnmDecoder::new(reader)?),
            ImageFormat::Tga => Box::new(TgaDecoder::new(reader)?),
            ImageFormat::Hdr => Box::new(HdrDecoder::new_nonstrict(reader)?),
            ImageFormat::Tiff => {
                let mut decoder = TiffDecoder::new(reader)?;
                let (width, height) = decoder.dimensions();
                check_size(u64::from(width), u64::from(height))?;
                decoder.set_limits(spare(decoder.total_bytes() + length))?;
                Box::new(decoder)
            }
            other => bail!("expected {FORMATS}, found {other:?}"),
        })
    };
    let decoder =
        make().context("its header is damaged, or of a rare variant; export it again, or as PNG")?;
    let (width, height) = decoder.dimensions();
    check_size(u64::from(width), u64::from(height))?;
    Ok(decoder)
}

fn pixels(decoded: DynamicImage) -> Pixels {
    match decoded {
        DynamicImage::ImageLuma8(image) => Pixels::Srgb8(grey(&image, u8::MAX)),
        DynamicImage::ImageLumaA8(image) => Pixels::Srgb8(grey_alpha(&image)),
        DynamicImage::ImageRgb8(image) => Pixels::Srgb8(color(&image, u8::MAX)),
        DynamicImage::ImageRgba8(image) => Pixels::Srgb8(image.as_chunks().0.to_vec()),
        DynamicImage::ImageLuma16(image) => Pixels::Srgb16(grey(&image, u16::MAX)),
        DynamicImage::ImageLumaA16(image) => Pixels::Srgb16(grey_alpha(&image)),
        DynamicImage::ImageRgb16(image) => Pixels::Srgb16(color(&image, u16::MAX)),
        DynamicImage::ImageRgba16(image) => Pixels::Srgb16(image.as_chunks().0.to_vec()),
        other => {
            let pixel = |&[r, g, b, a]: &[f32; 4]| {
                let [r, g, b] = [r, g, b].map(finite);
                [r, g, b, finite(a).clamp(0.0, 1.0)]
            };
            Pixels::Linear(other.into_rgba32f().as_chunks().0.iter().map(pixel).collect())
        }
    }
}

fn grey<T: Copy>(values: &[T], opaque: T) -> Vec<[T; 4]> {
    values.iter().map(|&grey| [grey, grey, grey, opaque]).collect()
}

fn grey_alpha<T: Copy>(values: &[T]) -> Vec<[T; 4]> {
    values.as_chunks().0.iter().map(|&[grey, alpha]| [grey, grey, grey, alpha]).collect()
}

fn color<T: Copy>(values: &[T], opaque: T) -> Vec<[T; 4]> {
    values.as_chunks().0.iter().map(|&[r, g, b]| [r, g, b, opaque]).collect()
}
