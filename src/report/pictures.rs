//! Small pictures of a view, as `data:` addresses: the rendering, the photo, and where they differ.

use crate::picture::quantised;
use anyhow::{Context, Result};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::imageops::{FilterType, resize};
use image::{ExtendedColorType, ImageBuffer, ImageEncoder, Rgb};

/// The longest side of a picture, in pixels; larger views are reduced.
pub const LONGEST_SIDE: u32 = 384;
/// The absolute error that is drawn brightest, of colours in `[0, 1]`.
pub const ERROR_SCALE: f32 = 0.1;
/// Pictures of at most so many pixels are PNG, and exact; others are JPEG.
const LOSSLESS: u32 = 128 * 128;
const QUALITY: u8 = 88;

/// The colours of errors from 0 to [`ERROR_SCALE`]: the map “inferno” of Smith and van der Walt (2015), equally
/// bright steps for equal steps of the error.
pub(super) const HEAT: [[u8; 3]; 9] = [
    [0x00, 0x00, 0x04],
    [0x1f, 0x0c, 0x48],
    [0x55, 0x0f, 0x6d],
    [0x88, 0x22, 0x6a],
    [0xba, 0x36, 0x55],
    [0xe3, 0x59, 0x33],
    [0xf9, 0x8c, 0x0a],
    [0xf9, 0xc9, 0x32],
    [0xfc, 0xff, 0xa4],
];

type Picture = ImageBuffer<Rgb<f32>, Vec<f32>>;

/// A rendering and its photo: display-referred colours in `[0, 1]`, row by row, `[height * width]`.
#[derive(Clone, Copy, Debug)]
pub struct Pair<'a> {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// The rendering.
    pub rendered: &'a [[f32; 3]],
    /// The photo.
    pub photo: &'a [[f32; 3]],
}

/// Three pictures of one view and one size.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pictures {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// The rendering.
    pub rendered: String,
    /// The photo.
    pub photo: String,
    /// The absolute error, mean of the channels, from black for 0 to pale yellow for [`ERROR_SCALE`] and more.
    pub error: String,
}

impl Pictures {
    /// Reduces, colours and encodes.
    ///
    /// # Errors
    /// When the numbers of pixels do not agree.
    pub fn new(pair: &Pair<'_>) -> Result<Self> {
        let differ = |(a, b): (&[f32; 3], &[f32; 3])| {
            let sum: f32 = a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum();
            [sum / 3.0; 3]
        };
        let errors: Vec<_> = pair.rendered.iter().zip(pair.photo).map(differ).collect();
        let [rendered, photo, error] = [pair.rendered, pair.photo, &errors].map(|p| reduced(p, pair.size));
        let (rendered, photo, error) = (rendered?, photo?, error?);
        Ok(Self {
            size: [error.width(), error.height()],
            rendered: encoded(&rendered, |color| color.map(quantised))?,
            photo: encoded(&photo, |color| color.map(quantised))?,
            error: encoded(&error, |[error, ..]| heat(error / ERROR_SCALE))?,
        })
    }
}

/// The picture at its own size, or at the largest one allowed; each pixel is the mean of what it covers.
fn reduced(pixels: &[[f32; 3]], [width, height]: [u32; 2]) -> Result<Picture> {
    let picture = Picture::from_raw(width, height, pixels.as_flattened().to_vec());
    let picture = picture
        .with_context(|| format!("expected {width}x{height} pixels in a picture, found {}", pixels.len()))?;
    let longest = width.max(height);
    if longest <= LONGEST_SIDE {
        return Ok(picture);
    }
    let side = |side: u32| (side * LONGEST_SIDE).div_ceil(longest).max(1);
    Ok(resize(&picture, side(width), side(height), FilterType::Triangle))
}

fn encoded(picture: &Picture, color: impl Fn([f32; 3]) -> [u8; 3]) -> Result<String> {
    let bytes: Vec<u8> = picture.pixels().flat_map(|pixel| color(pixel.0)).collect();
    let (width, height) = picture.dimensions();
    let mut file = Vec::new();
    let format = if width * height <= LOSSLESS {
        PngEncoder::new(&mut file).write_image(&bytes, width, height, ExtendedColorType::Rgb8)?;
        "png"
    } else {
        JpegEncoder::new_with_quality(&mut file, QUALITY).encode(
            &bytes,
            width,
            height,
            ExtendedColorType::Rgb8,
        )?;
        "jpeg"
    };
    Ok(format!("data:image/{format};base64,{}", STANDARD.encode(file)))
}

/// The colour of `part` in `[0, 1]` of the scale; what is not a number is as bad as can be.
fn heat(part: f32) -> [u8; 3] {
    let part = if part.is_nan() { 1.0 } else { part.clamp(0.0, 1.0) };
    let place = part * (HEAT.len() - 1) as f32;
    let below = (place as usize).min(HEAT.len() - 2);
    let (a, b, t) = (HEAT[below], HEAT[below + 1], place - below as f32);
    std::array::from_fn(|i| (f32::from(a[i]) * (1.0 - t) + f32::from(b[i]) * t + 0.5) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_go_from_black_to_pale_yellow() {
        assert_eq!((heat(0.0), heat(1.0), heat(9.0), heat(-1.0)), (HEAT[0], HEAT[8], HEAT[8], HEAT[0]));
        assert_eq!((heat(0.5), heat(f32::NAN)), (HEAT[4], HEAT[8]));
        let between = heat(1.0 / 16.0);
        assert_eq!(between, [0x10, 0x06, 0x26]);
    }

    #[test]
    fn a_reduced_pixel_is_the_mean_of_what_it_covers() {
        let stripes: Vec<_> = (0..4 * LONGEST_SIDE).map(|x| [(x / 2 % 2) as f32; 3]).collect();
        let reduced = reduced(&stripes, [4 * LONGEST_SIDE, 1]).expect("pixels");
        assert_eq!(reduced.dimensions(), (LONGEST_SIDE, 1));
        // At both ends the filter covers less.
        let inner = (1..LONGEST_SIDE - 1).map(|x| reduced[(x, 0)][0]);
        assert!(inner.into_iter().all(|value| (value - 0.5).abs() < 0.01));
    }
}
