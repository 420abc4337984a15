//! Depth maps: one number per pixel, whole ones in steps of some size, or floats.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use ::image::ImageFormat;
use ::tiff::decoder::{Decoder, DecodingResult, Limits};
use anyhow::{Context, Result, bail, ensure};

use super::decode::FileFormat;
use super::{check_size, decode, npy, of_file, open_exr};
use crate::photo::{BitDepth, Pixels};

/// A depth map as its file has it.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The numbers, row by row from the top-left corner, `[height * width]`; whatever a file has where depth
    /// is unknown: 0, negative or not finite. The largest of the whole numbers that a file can hold means that depth is
    /// larger still, and is infinite.
    pub values: Vec<f32>,
    /// Whether the file has whole numbers, which count steps, rather than lengths.
    pub is_integer: bool,
    /// Whether those have 8 bits only: hardly depth, rather a picture of it.
    pub is_8_bit: bool,
}

/// Reads a depth map: a grey image of 8 or 16 bits, a TIFF with one channel of any number format, NumPy's `.npy`, or channel
/// Z of an OpenEXR file, else V, Y, R, else its only one.
///
/// # Errors
/// When the file cannot be read or holds a picture of depth in colours.
pub fn load_depth(path: &Path) -> Result<DepthMap> {
    of_file(path, || load(path))
}

fn load(path: &Path) -> Result<DepthMap> {
    if is_npy(path)? {
        let npy::Array { width, height, values, integer_bytes } = npy::load(path)?;
        let (is_integer, is_8_bit) = (integer_bytes.is_some(), integer_bytes == Some(1));
        return Ok(DepthMap { width, height, values, is_integer, is_8_bit });
    }
    let format = FileFormat::detect(path)
        .context("expected depth as a grey PNG of 16 bits, TIFF, OpenEXR or NumPy's .npy")?;
    match format {
        FileFormat::OpenExr => {
            let (width, height, values) = open_exr::load_depth(path)?;
            Ok(DepthMap { width, height, values, is_integer: false, is_8_bit: false })
        }
        FileFormat::Common(ImageFormat::Tiff) => load_tiff(path),
        FileFormat::Common(format) => load_grey(path, format),
    }
}

fn is_npy(path: &Path) -> Result<bool> {
    let mut magic = Vec::new();
    File::open(path)?.take(npy::MAGIC.len() as u64).read_to_end(&mut magic)?;
    Ok(magic == npy::MAGIC)
}

fn load_grey(path: &Path, format: ImageFormat) -> Result<DepthMap> {
    let image = decode::load(path, format)?;
    let values = match &image.pixels {
        Pixels::Srgb8(pixels) => grey(pixels, |value| steps(value, u8::MAX)),
        Pixels::Srgb16(pixels) => grey(pixels, |value| steps(value, u16::MAX)),
        Pixels::Linear(pixels) => grey(pixels, |value| value),
    };
    let values = values.context(
        "expected a grey image whose values are depths, found one in colours; export depth itself, not a picture of it",
    )?;
    let is_8_bit = image.pixels.bits() == BitDepth::Eight;
    Ok(DepthMap { width: image.width, height: image.height, values, is_integer: !image.is_hdr(), is_8_bit })
}

fn grey<T: Copy + PartialEq>(pixels: &[[T; 4]], depth: impl Fn(T) -> f32) -> Option<Vec<f32>> {
    let value = |&[r, g, b, _]: &[T; 4]| (r == g && g == b).then(|| depth(r));
    pixels.iter().map(value).collect()
}

/// A number of steps; infinite where it is the `most` that there can be.
fn steps<T: PartialEq + Into<f64>>(value: T, most: T) -> f32 {
    if value == most { f32::INFINITY } else { value.into() as f32 }
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
    let mut is_8_bit = false;
    let (values, is_integer) = match decoder.read_image()? {
        DecodingResult::U8(values) => {
            is_8_bit = true;
            (values.into_iter().map(|value| steps(value, u8::MAX)).collect(), true)
        }
        DecodingResult::U16(values) => {
            (values.into_iter().map(|value| steps(value, u16::MAX)).collect(), true)
        }
        DecodingResult::U32(values) => {
            (values.into_iter().map(|value| steps(value, u32::MAX)).collect(), true)
        }
        DecodingResult::I16(values) => {
            (values.into_iter().map(|value| steps(value, i16::MAX)).collect(), true)
        }
        DecodingResult::I32(values) => {
            (values.into_iter().map(|value| steps(value, i32::MAX)).collect(), true)
        }
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
    Ok(DepthMap { width, height, values, is_integer, is_8_bit })
}
