//! Depth maps: one number per pixel, whole ones in steps of some size, or floats.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use ::image::ImageFormat;
use ::tiff::decoder::{Decoder, DecodingResult, Limits};
use anyhow::{Context, Result, bail, ensure};

use super::decode::FileFormat;
use super::{check_size, decode, of_file, open_exr};
use crate::photo::Pixels;

/// A depth map as its file has it.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The numbers, row by row from the top-left corner, `[height * width]`; whatever a file has where depth
    /// is unknown: 0, negative or not finite.
    pub values: Vec<f32>,
    /// Whether the file has whole numbers, which count steps, rather than lengths.
    pub is_integer: bool,
}

/// Reads a depth map: a grey image of 8 or 16 bits, a TIFF with one channel of any number format, or channel Z
/// of an OpenEXR file, else V, Y, R, else its only one.
///
/// # Errors
/// When the file cannot be read or holds a picture of depth in colours.
pub fn load_depth(path: &Path) -> Result<DepthMap> {
    let load = || match FileFormat::detect(path)? {
        FileFormat::OpenExr => {
            let (width, height, values) = open_exr::load_depth(path)?;
            Ok(DepthMap { width, height, values, is_integer: false })
        }
        FileFormat::Common(ImageFormat::Tiff) => load_tiff(path),
        FileFormat::Common(format) => load_grey(path, format),
    };
    of_file(path, load)
}

fn load_grey(path: &Path, format: ImageFormat) -> Result<DepthMap> {
    let image = decode::load(path, format)?;
    let is_integer = !image.is_hdr();
    let values = match &image.pixels {
        Pixels::Srgb8(pixels) => grey(pixels),
        Pixels::Srgb16(pixels) => grey(pixels),
        Pixels::Linear(pixels) => grey(pixels),
    };
    let values = values.context(
        "expected a grey image whose values are depths, found one in colours; export depth itself, not a picture of it",
    )?;
    Ok(DepthMap { width: image.width, height: image.height, values, is_integer })
}

fn grey<T: Copy + PartialEq + Into<f32>>(pixels: &[[T; 4]]) -> Option<Vec<f32>> {
    let value = |&[r, g, b, _]: &[T; 4]| (r == g && g == b).then(|| r.into());
    pixels.iter().map(value).collect()
}

fn load_tiff(path: &Path) -> Result<DepthMap> {
    let file = File::open(path)?;
    let length = usize::try_from(file.metadata()?.len())?;
    let mut decoder = Decoder::new(BufReader::new(file))?;
    let (width, height) = decoder.dimensions()?;
    check_size(u64::from(width), u64::from(height))?;
    let count = width as usize * height as usize;
    let mut limits = Limits::default();
    limits.decoding_buffer_size = count * size_of::<f64>();
    limits.intermediate_buffer_size = limits.decoding_buffer_size + length;
    let mut decoder = decoder.with_limits(limits);
    let (values, is_integer) = match decoder.read_image()? {
        DecodingResult::U8(values) => (values.into_iter().map(f32::from).collect(), true),
        DecodingResult::U16(values) => (values.into_iter().map(f32::from).collect(), true),
        DecodingResult::U32(values) => (values.into_iter().map(|value| value as f32).collect(), true),
        DecodingResult::I16(values) => (values.into_iter().map(f32::from).collect(), true),
        DecodingResult::I32(values) => (values.into_iter().map(|value| value as f32).collect(), true),
        DecodingResult::F16(values) => (values.into_iter().map(f32::from).collect(), false),
        DecodingResult::F32(values) => (values, false),
        DecodingResult::F64(values) => {
            (values.into_iter().map(|value| value as f32).collect::<Vec<_>>(), false)
        }
        _ => bail!("its number format is not supported; export depth as 32-bit floats"),
    };
    ensure!(
        values.len() == count,
        "expected one channel, {count} values, found {}; export depth alone",
        values.len()
    );
    Ok(DepthMap { width, height, values, is_integer })
}
