//! Small pictures of a view, as `data:` addresses: the rendering and its depth, the photo, and where they differ.

use super::colormap::{INFERNO, VIRIDIS, color};
use crate::photo::color_space::quantised;
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
/// The greys of what masks ignore, in stripes: no colour of an error's scale.
const IGNORED: [[u8; 3]; 2] = [[0x5c; 3], [0x94; 3]];
/// The width of those stripes across, in pixels.
const STRIPE: u32 = 4;

type Picture = ImageBuffer<Rgb<f32>, Vec<f32>>;

/// A rendering and its photo, row by row, `[height * width]`; colours are display-referred, in `[0, 1]`.
#[derive(Clone, Copy, Debug)]
pub struct Pair<'a> {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// The rendering.
    pub rendered: &'a [[f32; 3]],
    /// The photo.
    pub photo: &'a [[f32; 3]],
    /// Where masks ignore the photo, so that there is no error; empty where they do so nowhere.
    pub ignored: &'a [bool],
    /// The rendering's depth in world units, 0 where nothing is.
    pub depth: &'a [f32],
    /// The depth that lies in the middle of the scale, in world units.
    pub unit: f64,
}

/// Four pictures of one view and one size.
#[derive(Clone, Debug, PartialEq)]
pub struct Pictures {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// The rendering.
    pub rendered: String,
    /// The photo.
    pub photo: String,
    /// The absolute error, mean of the channels, from black for 0 to pale yellow for [`ERROR_SCALE`] and more; grey
    /// stripes where masks ignore the photo.
    pub error: String,
    /// Whether masks ignore some of the photo.
    pub has_ignored: bool,
    /// The depth, from yellow for what is near to violet for what is far, linear in `1 / (1 + (depth / unit)³)`; black
    /// where nothing is.
    pub depth: String,
    /// The depth that lies in the middle of the scale, in world units.
    pub unit: f64,
}

impl Pictures {
    /// Reduces, colours and encodes.
    ///
    /// # Errors
    /// When the numbers of pixels do not agree.
    pub fn new(pair: &Pair<'_>) -> Result<Self> {
        // Beside the error, whether it counts: a reduced pixel may cover both what does and what does not.
        let differ = |(index, (a, b)): (usize, (&[f32; 3], &[f32; 3]))| {
            let sum: f32 = a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum();
            if pair.ignored.get(index) == Some(&true) { [0.0; 3] } else { [sum / 3.0, 1.0, 0.0] }
        };
        let errors: Vec<_> = pair.rendered.iter().zip(pair.photo).enumerate().map(differ).collect();
        // Beside its place on the scale, whether there is any.
        let place = |&z: &f32| match z > 0.0 {
            true => [nearness(f64::from(z) / pair.unit) as f32, 1.0, 0.0],
            false => [0.0; 3],
        };
        let depths: Vec<_> = pair.depth.iter().map(place).collect();
        let reduced = |pixels| reduced(pixels, pair.size);
        let (rendered, photo) = (reduced(pair.rendered)?, reduced(pair.photo)?);
        let (error, depth) = (reduced(&errors)?, reduced(&depths)?);
        Ok(Self {
            size: [error.width(), error.height()],
            rendered: encoded(&rendered, |_, color| color.map(quantised))?,
            photo: encoded(&photo, |_, color| color.map(quantised))?,
            error: encoded(&error, |[x, y], [error, counted, _]| match counted < 0.5 {
                true => IGNORED[((x + y) / STRIPE % 2) as usize],
                false => color(&INFERNO, error / counted / ERROR_SCALE),
            })?,
            has_ignored: pair.ignored.contains(&true),
            depth: encoded(&depth, |_, [place, covered, _]| match covered < 0.5 {
                true => [0; 3],
                false => color(&VIRIDIS, place / covered),
            })?,
            unit: pair.unit,
        })
    }
}

/// The place of a relative depth `d` on the scale of depths: `1 / (1 + d³)`, so that 1 lies in the middle, 0 at its
/// bright end, and what is endlessly far at its dark one.
pub(super) fn nearness(relative: f64) -> f64 {
    1.0 / (1.0 + relative.powi(3))
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

/// The picture's file; `color` makes a pixel's colour of its place and values.
fn encoded(picture: &Picture, color: impl Fn([u32; 2], [f32; 3]) -> [u8; 3]) -> Result<String> {
    let bytes: Vec<u8> =
        picture.enumerate_pixels().flat_map(|(x, y, pixel)| color([x, y], pixel.0)).collect();
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_depths_are_bright() {
        let places = [0.0, 0.5, 1.0, 2.0, f64::INFINITY].map(nearness);
        assert_eq!(places, [1.0, 8.0 / 9.0, 0.5, 1.0 / 9.0, 0.0]);
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
