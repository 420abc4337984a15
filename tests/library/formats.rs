//! Image files of every format: what their pixels become, and what damaged ones are refused with.

use std::path::{Path, PathBuf};

use crate::support::folder;
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image as ExrImage, Layer,
    LayerAttributes, LineOrder, Vec2, WritableImage, f16,
};
use image::{DynamicImage, GrayAlphaImage, GrayImage, ImageBuffer, ImageFormat, Rgb, Rgba};
use nerf::capture::image_file::{Header, MOST_PIXELS, load_depth};
use nerf::photo::{BitDepth, Image, Pixels};
use proptest::prelude::*;

/// A 4x1 PNG with a palette of four colours, two bits a pixel, the second one half transparent.
const PALETTE: [u8; 105] = [
    137, 80, 78, 71, 13, 10, 26, 10, 0, 0, 0, 13, 73, 72, 68, 82, 0, 0, 0, 4, 0, 0, 0, 1, 2, 3, 0, 0, 0, 132,
    82, 231, 94, 0, 0, 0, 12, 80, 76, 84, 69, 255, 0, 0, 0, 255, 0, 0, 0, 255, 9, 8, 7, 162, 210, 98, 192, 0,
    0, 0, 2, 116, 82, 78, 83, 255, 128, 8, 15, 179, 106, 0, 0, 0, 10, 73, 68, 65, 84, 120, 156, 99, 144, 6,
    0, 0, 29, 0, 28, 142, 244, 245, 33, 0, 0, 0, 0, 73, 69, 78, 68, 174, 66, 96, 130,
];

/// Writes a picture in a format, under a name that does not tell it.
fn write(folder: &Path, picture: &DynamicImage, format: ImageFormat) -> PathBuf {
    let path = folder.join("photo.dat");
    picture.save_with_format(&path, format).expect("writable");
    path
}

fn opaque8() -> DynamicImage {
    let color = |x, y| Rgb([10 * x as u8, 200 - 20 * y as u8, 77]);
    DynamicImage::ImageRgb8(ImageBuffer::from_fn(9, 6, color))
}

fn cutout8() -> DynamicImage {
    let color = |x, y| Rgba([10 * x as u8, 200 - 20 * y as u8, 77, 30 * x as u8]);
    DynamicImage::ImageRgba8(ImageBuffer::from_fn(9, 6, color))
}

fn opaque16() -> DynamicImage {
    DynamicImage::ImageRgb16(ImageBuffer::from_fn(9, 6, |x, y| Rgb([7001 * x as u16, 9001 * y as u16, 3])))
}

fn cutout16() -> DynamicImage {
    let color = |x, y| Rgba([7001 * x as u16, 9001 * y as u16, 3, 65535 - 5000 * x as u16]);
    DynamicImage::ImageRgba16(ImageBuffer::from_fn(9, 6, color))
}

fn linear() -> DynamicImage {
    DynamicImage::ImageRgb32F(ImageBuffer::from_fn(9, 6, |x, y| Rgb([0.5 * x as f32, 4.0 * y as f32, 100.0])))
}

/// The pixels that a picture should become.
fn expected(picture: &DynamicImage) -> Pixels {
    match picture {
        DynamicImage::ImageRgb32F(_) => Pixels::Linear(picture.to_rgba32f().as_chunks().0.to_vec()),
        DynamicImage::ImageRgb16(_) | DynamicImage::ImageRgba16(_) => {
            Pixels::Srgb16(picture.to_rgba16().as_chunks().0.to_vec())
        }
        _ => Pixels::Srgb8(picture.to_rgba8().as_chunks().0.to_vec()),
    }
}

#[test]
fn lossless_formats_keep_every_bit() {
    use ImageFormat::{Bmp, Hdr, Png, Tiff, WebP};
    let folder = folder();
    let cases = [
        (opaque8(), vec![Png, Tiff, WebP, Bmp]),
        (cutout8(), vec![Png, Tiff, WebP, Bmp]),
        (opaque16(), vec![Png, Tiff]),
        (cutout16(), vec![Png, Tiff]),
        (linear(), vec![Tiff, Hdr]),
    ];
    for (picture, formats) in cases {
        for format in formats {
            let path = write(folder.path(), &picture, format);
            let image = Image::load(&path).unwrap_or_else(|error| panic!("{format:?}: {error:#}"));
            let what = format!("{format:?} {:?}", picture.color());
            assert_eq!(image.size(), [9, 6], "{what}");
            assert_eq!(image.has_alpha, picture.color().has_alpha(), "{what}");
            match (&image.pixels, &expected(&picture), format) {
                // The format has one exponent for all three colours, of 8 bits each.
                (Pixels::Linear(got), Pixels::Linear(want), Hdr) => {
                    for (got, want) in got.iter().zip(want) {
                        let step = want[..3].iter().fold(0.0_f32, |a, &b| a.max(b)) / 128.0;
                        assert!(got.iter().zip(want).all(|(a, b)| (a - b).abs() <= step), "{got:?} {want:?}");
                    }
                }
                (got, want, _) => assert_eq!(got, want, "{what}"),
            }
            let header = Header::read(&path).expect("readable");
            assert_eq!(header.bits, image.pixels.bits(), "{what}");
            assert_eq!((header.has_alpha, header.orientation), (image.has_alpha, None), "{what}");
            assert_eq!([header.width, header.height], image.size(), "{what}");
        }
    }
}

#[test]
fn grey_and_palettes_become_colours() {
    let folder = folder();
    let path = folder.path().join("grey");
    let save = |picture: DynamicImage| picture.save_with_format(&path, ImageFormat::Png).expect("writable");
    save(DynamicImage::ImageLuma8(GrayImage::from_raw(2, 1, vec![7, 9]).expect("2x1")));
    let grey = Image::load(&path).expect("readable");
    assert_eq!(grey.pixels, Pixels::Srgb8(vec![[7, 7, 7, 255], [9, 9, 9, 255]]));
    save(DynamicImage::ImageLumaA8(GrayAlphaImage::from_raw(1, 1, vec![7, 9]).expect("1x1")));
    assert_eq!(Image::load(&path).expect("readable").pixels, Pixels::Srgb8(vec![[7, 7, 7, 9]]));
    let deep = ImageBuffer::from_raw(1, 1, vec![700_u16, 900]).expect("1x1");
    save(DynamicImage::ImageLumaA16(deep));
    assert_eq!(Image::load(&path).expect("readable").pixels, Pixels::Srgb16(vec![[700, 700, 700, 900]]));
    std::fs::write(&path, PALETTE).expect("writable");
    let colors = vec![[255, 0, 0, 255], [0, 255, 0, 128], [0, 0, 255, 255], [9, 8, 7, 255]];
    assert_eq!(Image::load(&path).expect("readable").pixels, Pixels::Srgb8(colors));
}

#[test]
fn jpeg_and_radiance_of_either_name() {
    let folder = folder();
    let flat = DynamicImage::ImageRgb8(ImageBuffer::from_pixel(16, 8, Rgb([200, 100, 50])));
    let image = Image::load(&write(folder.path(), &flat, ImageFormat::Jpeg)).expect("readable");
    let Pixels::Srgb8(pixels) = &image.pixels else { panic!("8 bits") };
    let close = |got: &[u8; 4]| got.iter().zip([200, 100, 50, 255]).all(|(a, b)| a.abs_diff(b) <= 2);
    assert!(pixels.iter().all(close), "{:?}", pixels[0]);
    let path = write(folder.path(), &linear(), ImageFormat::Hdr);
    let radiance = Image::load(&path).expect("readable");
    let bytes = std::fs::read(&path).expect("readable");
    let other = [&b"#?RGBE"[..], bytes.strip_prefix(b"#?RADIANCE").expect("the usual name")].concat();
    std::fs::write(&path, other).expect("writable");
    assert_eq!(Image::load(&path).expect("readable"), radiance);
    assert!(radiance.is_hdr() && !radiance.has_alpha);
}

type ExrLayer = Layer<AnyChannels<FlatSamples>>;

fn layer(size: (usize, usize), encoding: Encoding, channels: Vec<(&str, FlatSamples)>) -> ExrLayer {
    let channels = channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
    Layer::new(size, LayerAttributes::default(), encoding, AnyChannels::sort(channels))
}

fn write_exr(folder: &Path, layer: ExrLayer) -> PathBuf {
    let path = folder.join("view.png");
    ExrImage::from_layer(layer).write().to_file(&path).expect("writable");
    path
}

fn ramp(offset: f32) -> Vec<f32> {
    (0..70 * 50).map(|i| offset + i as f32).collect()
}

#[test]
fn openexr_in_many_shapes() {
    let folder = folder();
    let tiles = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::Tiles(Vec2(32, 16)),
        line_order: LineOrder::Increasing,
    };
    let halves = |values: Vec<f32>| values.into_iter().map(f16::from_f32).collect();
    let mixed = vec![
        ("B", FlatSamples::F32(ramp(0.5))),
        ("A", FlatSamples::F32(vec![0.25; 70 * 50])),
        ("R", FlatSamples::U32((0..70 * 50).collect())),
        ("G", FlatSamples::F16(halves(vec![1.5; 70 * 50]))),
        ("normal.X", FlatSamples::F32(ramp(-7.0))),
    ];
    for encoding in [tiles, Encoding::UNCOMPRESSED, Encoding::FAST_LOSSLESS, Encoding::SMALL_LOSSLESS] {
        let path = write_exr(folder.path(), layer((70, 50), encoding, mixed.clone()));
        let image = Image::load(&path).expect("readable");
        let Pixels::Linear(pixels) = &image.pixels else { panic!("linear") };
        let expected = (0..70 * 50).map(|i| [i as f32, 1.5, 0.5 + i as f32, 0.25]);
        assert!(pixels.iter().copied().eq(expected), "{encoding:?}");
        assert!(image.has_alpha && image.is_cutout());
    }
    let grey = vec![("Y", FlatSamples::F32(ramp(0.0)))];
    let image = Image::load(&write_exr(folder.path(), layer((70, 50), tiles, grey))).expect("readable");
    let Pixels::Linear(pixels) = &image.pixels else { panic!("linear") };
    assert_eq!((pixels[3], image.has_alpha), ([3.0, 3.0, 3.0, 1.0], false));
    let named = ["beauty.R", "beauty.G", "beauty.B", "beauty.A"];
    let named = named.into_iter().map(|name| (name, FlatSamples::F32(ramp(1.0)))).collect();
    let image = Image::load(&write_exr(folder.path(), layer((70, 50), tiles, named))).expect("readable");
    assert!(image.has_alpha);
    let lonely = vec![("R", FlatSamples::F32(ramp(0.0)))];
    let path = write_exr(folder.path(), layer((70, 50), tiles, lonely));
    let message = format!("{:#}", Image::load(&path).expect_err("no green"));
    assert!(message.contains("expected the channels R, G and B, found R"), "{message}");
}

#[test]
fn openexr_windows() {
    let folder = folder();
    let colors = ["R", "G", "B", "A"].map(|name| (name, FlatSamples::F32(vec![1.0; 6])));
    let mut small = layer((3, 2), Encoding::UNCOMPRESSED, colors.to_vec());
    small.attributes.layer_position = Vec2(1, -1);
    let mut image = ExrImage::from_layer(small);
    image.attributes.display_window.position = Vec2(0, 0);
    image.attributes.display_window.size = Vec2(5, 3);
    let path = folder.path().join("window.exr");
    image.write().to_file(&path).expect("writable");
    let shown = Image::load(&path).expect("readable");
    let Pixels::Linear(pixels) = &shown.pixels else { panic!("linear") };
    assert_eq!(shown.size(), [5, 3]);
    let inside: Vec<_> = (0..15).filter(|&i| pixels[i] == [1.0; 4]).collect();
    assert_eq!(inside, [1, 2, 3], "one row of the stored pixels is above the window");
    assert!((0..15).filter(|i| !inside.contains(i)).all(|i| pixels[i] == [0.0; 4]));
}

#[test]
fn depth_in_integers_and_floats() {
    let folder = folder();
    let path = folder.path().join("depth");
    let deep = ImageBuffer::from_raw(2, 1, vec![0_u16, 1500]).expect("2x1");
    DynamicImage::ImageLuma16(deep).save_with_format(&path, ImageFormat::Png).expect("writable");
    let map = load_depth(&path).expect("readable");
    assert_eq!((map.width, map.height, map.is_integer, &map.values[..]), (2, 1, true, &[0.0, 1500.0][..]));
    opaque8().save_with_format(&path, ImageFormat::Png).expect("writable");
    let message = format!("{:#}", load_depth(&path).expect_err("a picture in colours"));
    assert!(message.contains("expected a grey image") && message.contains("depth"), "{message}");
    let file = std::fs::File::create(&path).expect("writable");
    let mut tiff = tiff::encoder::TiffEncoder::new(file).expect("writable");
    tiff.write_image::<tiff::encoder::colortype::Gray32Float>(2, 1, &[0.25, f32::INFINITY])
        .expect("writable");
    let map = load_depth(&path).expect("readable");
    assert_eq!((map.is_integer, &map.values[..]), (false, &[0.25, f32::INFINITY][..]));
    let value = |value: f32| FlatSamples::F32(vec![value; 4]);
    for (channels, depth) in [
        (vec![("R", value(1.0)), ("Z", value(2.0)), ("A", value(1.0))], 2.0),
        (vec![("V", value(3.0)), ("R", value(1.0))], 3.0),
        (vec![("Y", value(4.0))], 4.0),
        (vec![("R", value(5.0)), ("G", value(6.0))], 5.0),
        (vec![("distance", value(7.0))], 7.0),
    ] {
        let path = write_exr(folder.path(), layer((2, 2), Encoding::UNCOMPRESSED, channels));
        let map = load_depth(&path).expect("readable");
        assert_eq!((map.is_integer, &map.values[..]), (false, &[depth; 4][..]));
    }
    let two = vec![("near", value(1.0)), ("far", value(2.0))];
    let path = write_exr(folder.path(), layer((2, 2), Encoding::UNCOMPRESSED, two));
    let message = format!("{:#}", load_depth(&path).expect_err("which one?"));
    assert!(message.contains("expected a channel Z, found far, near"), "{message}");
}

/// A small valid file of every format, each with a name for messages.
fn samples() -> Vec<(String, Vec<u8>)> {
    use ImageFormat::{Bmp, Hdr, Jpeg, Png, Tiff, WebP};
    let folder = folder();
    let mut samples = Vec::new();
    let cases = [
        (opaque8(), Jpeg),
        (cutout8(), Png),
        (opaque16(), Png),
        (cutout8(), WebP),
        (opaque16(), Tiff),
        (linear(), Tiff),
        (cutout8(), Bmp),
        (linear(), Hdr),
    ];
    for (picture, format) in cases {
        let path = write(folder.path(), &picture, format);
        samples.push((format!("{format:?} {:?}", picture.color()), std::fs::read(path).expect("readable")));
    }
    samples.push(("PNG with a palette".to_owned(), PALETTE.to_vec()));
    let tiles = Encoding {
        compression: Compression::PIZ,
        blocks: Blocks::Tiles(Vec2(8, 8)),
        line_order: LineOrder::Increasing,
    };
    for encoding in [tiles, Encoding::FAST_LOSSLESS, Encoding::SMALL_LOSSLESS] {
        let values: Vec<f32> = (0..12 * 10).map(|i| i as f32).collect();
        let channels = ["R", "G", "B", "A"].map(|name| (name, FlatSamples::F32(values.clone())));
        let path = write_exr(folder.path(), layer((12, 10), encoding, channels.to_vec()));
        samples.push((format!("OpenEXR {:?}", encoding.compression), std::fs::read(path).expect("readable")));
    }
    samples
}

#[test]
fn half_a_file_is_refused_by_name() {
    let folder = folder();
    let path = folder.path().join("half.jpg");
    for (what, bytes) in samples() {
        for part in [4, 3, 2] {
            std::fs::write(&path, &bytes[..bytes.len() / part]).expect("writable");
            let Err(error) = Image::load(&path) else { panic!("1/{part} of {what} was taken for whole") };
            let message = format!("{error:#}");
            assert!(message.contains("half.jpg"), "{what}: {message}");
        }
    }
}

#[test]
fn absurd_sizes_are_refused_before_memory_is_asked_for() {
    let folder = folder();
    let path = folder.path().join("bomb");
    let refused = |bytes: &[u8], what: &str| {
        std::fs::write(&path, bytes).expect("writable");
        let message = format!("{:#}", Image::load(&path).expect_err(what));
        assert!(message.contains("bomb") && message.contains("at most 268 megapixels"), "{what}: {message}");
        assert!(Header::read(&path).is_err(), "{what}");
    };
    refused(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 60000 +X 60000\n", "HDR");
    let mut jpeg = samples().remove(0).1;
    let frame = jpeg.windows(2).position(|pair| pair == [0xff, 0xc0]).expect("a baseline frame");
    jpeg[frame + 5..frame + 9].fill(0xff);
    refused(&jpeg, "JPEG");
    let (_, mut bmp) = samples().into_iter().find(|(name, _)| name.starts_with("Bmp")).expect("BMP");
    bmp[18..26].copy_from_slice(&[0x60, 0xea, 0, 0, 0x60, 0xea, 0, 0]);
    refused(&bmp, "BMP");
    let (_, mut exr) = samples().into_iter().find(|(name, _)| name.starts_with("OpenEXR")).expect("EXR");
    for window in [&b"dataWindow\0box2i\0"[..], b"displayWindow\0box2i\0"] {
        let at =
            exr.windows(window.len()).position(|bytes| bytes == window).expect("a window") + window.len();
        exr[at + 12..at + 20].copy_from_slice(&[255, 255, 0, 0, 255, 255, 0, 0]);
    }
    refused(&exr, "EXR");
}

#[test]
fn what_is_no_file_is_refused() {
    let folder = folder();
    let message = |name: &str| format!("{:#}", Image::load(&folder.path().join(name)).expect_err("no image"));
    std::fs::create_dir(folder.path().join("photo.png")).expect("writable");
    assert!(message("photo.png").contains("expected an image file, found a folder"));
    assert!(message("nothing.png").contains("nothing.png: No such file"));
    std::fs::write(folder.path().join("empty.png"), "").expect("writable");
    assert!(message("empty.png").contains("found an empty file"));
}

proptest! {
    /// Whatever happens to a file, reading it ends with pixels or with a message.
    #[test]
    fn damaged_files_never_panic(
        which in any::<prop::sample::Index>(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        end in prop::option::weighted(0.2, any::<prop::sample::Index>()),
    ) {
        thread_local!(static SAMPLES: Vec<(String, Vec<u8>)> = samples());
        let (what, mut bytes) = SAMPLES.with(|samples| samples[which.index(samples.len())].clone());
        for (at, value) in damage {
            // Headers, where it matters most, are at the front.
            let within = if value % 2 == 0 { bytes.len() } else { bytes.len().min(400) };
            let at = at.index(within);
            bytes[at] = value;
        }
        if let Some(end) = end {
            bytes.truncate(end.index(bytes.len()) + 1);
        }
        let folder = folder();
        let path = folder.path().join("damaged");
        std::fs::write(&path, &bytes).expect("writable");
        let header = Header::read(&path);
        if let Ok(image) = Image::load(&path) {
            let count = u64::from(image.width) * u64::from(image.height);
            prop_assert!(count > 0 && count <= MOST_PIXELS);
            let header = header.expect("of an image that can be read");
            prop_assert_eq!([header.width, header.height], image.size(), "{}", what);
            prop_assert_eq!(header.bits, image.pixels.bits());
            if let Pixels::Linear(pixels) = &image.pixels {
                prop_assert!(header.bits == BitDepth::Float);
                let is_sane = |pixel: &[f32; 4]| {
                    pixel.iter().all(|value| value.is_finite()) && (0.0..=1.0).contains(&pixel[3])
                };
                prop_assert!(pixels.iter().all(is_sane));
            }
        }
        let _ = load_depth(&path);
    }
}
