//! Image files: every format that is read, PNG and OpenEXR as they are written.

mod alpha;
mod color_key;
mod decode;
mod depth;
mod foreign;
mod jpeg;
mod mask;
mod npy;
mod open_exr;
mod pixel_grid;
mod reduce;
mod tga;

use std::path::Path;

use ::image::codecs::png::PngEncoder;
use ::image::metadata::Orientation;
use ::image::{ExtendedColorType, ImageEncoder};
use anyhow::{Context, Result, ensure};

use crate::photo::{BitDepth, Image, Pixels};
use crate::support::file::write_atomically;
pub(crate) use alpha::{Evidence, Multiplied};
pub(crate) use color_key::ColorKey;
use decode::FileFormat;
pub use depth::{DepthMap, load_depth};
pub use foreign::Foreign;
pub(crate) use mask::{MaskChannel, MaskFile};
pub use open_exr::{ExrPixels, Precision, read_exr_channel, write_exr};
pub use pixel_grid::{Turn, Window};
pub(crate) use pixel_grid::{crop, nearest};
pub(crate) use reduce::{reduce_any, reduce_depth};

/// The formats that [`Image::load`] reads, for messages.
pub const FORMATS: &str = "PNG, JPEG, WebP, TIFF, BMP, TGA, PNM, OpenEXR or Radiance HDR";

/// Most pixels of an image: more are a damaged header or a trap rather than a photo.
pub const MOST_PIXELS: u64 = 1 << 28;
/// Most pixels along one side of an image.
pub const LONGEST_SIDE: u32 = 1 << 16;

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
        let load = || match FileFormat::detect(path)? {
            FileFormat::OpenExr => open_exr::load(path),
            FileFormat::Common(format) => decode::load(path, format),
        };
        of_file(path, load)
    }

    /// 8-bit pixels in 16 bits; others as they are.
    pub(crate) fn in_16_bits(self) -> Self {
        let Pixels::Srgb8(pixels) = self.pixels else { return self };
        let pixels = pixels.iter().map(|pixel| pixel.map(|value| u16::from(value) * 257)).collect();
        Self { pixels: Pixels::Srgb16(pixels), ..self }
    }
}

impl Turn {
    /// The turn that an orientation in the metadata asks for; `None` for those that keep width and height.
    #[must_use]
    pub fn of(orientation: Orientation) -> Option<Self> {
        match orientation {
            Orientation::Rotate90 => Some(Self::Right),
            Orientation::Rotate270 => Some(Self::Left),
            Orientation::Rotate90FlipH => Some(Self::Transpose),
            Orientation::Rotate270FlipH => Some(Self::Transverse),
            _ => None,
        }
    }
}

impl Header {
    /// Reads the header of a file of any of the [`FORMATS`].
    ///
    /// # Errors
    /// As [`Image::load`].
    pub fn read(path: &Path) -> Result<Self> {
        let read = || match FileFormat::detect(path)? {
            FileFormat::OpenExr => open_exr::header(path),
            FileFormat::Common(format) => decode::header(path, format),
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
    fn tga_is_known_by_its_header() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let tga = folder.path().join("photo.tga");
        let colors = ImageBuffer::from_fn(3, 2, |x, y| Rgb([x as u8, y as u8, 200]));
        DynamicImage::ImageRgb8(colors).save(&tga).expect("writable");
        let expected: Vec<_> = (0..6).map(|at| [at % 3, at / 3, 200, 255]).collect();
        assert_eq!(Header::read(&tga).expect("readable").width, 3);
        assert_eq!(Image::load(&tga).expect("readable").pixels, Pixels::Srgb8(expected));
    }

    #[test]
    fn other_files_are_refused_by_name_and_type() {
        let folder = tempfile::tempdir().expect("temporary folder");
        for (bytes, expected) in [(&b"GIF89a......"[..], "found a GIF"), (b"", "found an empty file")] {
            let path = folder.path().join("photo.png");
            std::fs::write(&path, bytes).expect("writable");
            let message = format!("{:#}", Image::load(&path).expect_err("refused"));
            assert!(message.contains("photo.png") && message.contains(expected), "{message}");
            assert!(Header::read(&path).is_err());
        }
    }
}
