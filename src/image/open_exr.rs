//! OpenEXR files: channels found by name, half or float, written with colour, alpha and depth.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use ::exr::meta::MetaData;
use ::exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image as ExrImage, IntegerBounds, Layer,
    LayerAttributes, ReadChannels, ReadLayers, Vec2, WritableImage, f16, read,
};
use anyhow::{Context, Result, bail, ensure};

use super::{Header, Image, Pixels, check_count};
use crate::file::write_atomically;

/// What [`write_exr`] stores, each `[height * width]`.
#[derive(Clone, Copy, Debug)]
pub struct ExrPixels<'a> {
    /// Scene-linear colour premultiplied with alpha: channels R, G, B, A.
    pub color: &'a [[f32; 4]],
    /// Depth (see [`crate::camera::LensKind::depth_is_distance`]) in world units: channel Z.
    pub depth: Option<&'a [f32]>,
}

/// How R, G, B and A are stored; Z is always a float.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 32 bits.
    Float,
    /// 16 bits; values beyond ±65504 are clamped.
    Half,
}

/// Writes a scan-line OpenEXR file.
pub fn write_exr(
    path: &Path,
    width: u32,
    height: u32,
    pixels: &ExrPixels,
    precision: Precision,
) -> Result<()> {
    check_count(width, height, pixels.color.len())?;
    let mut channels = Vec::new();
    for (index, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
        let values = pixels.color.iter().map(|pixel| pixel[index]);
        let samples = match precision {
            Precision::Float => FlatSamples::F32(values.collect()),
            Precision::Half => FlatSamples::F16(values.map(half).collect()),
        };
        channels.push(AnyChannel::new(name, samples));
    }
    if let Some(depth) = pixels.depth {
        check_count(width, height, depth.len())?;
        let samples = FlatSamples::F32(depth.to_vec());
        channels.push(AnyChannel::new("Z", samples));
    }
    let encoding = Encoding { compression: Compression::ZIP16, ..Encoding::UNCOMPRESSED };
    let layer = Layer::new(
        (width as usize, height as usize),
        LayerAttributes::default(),
        encoding,
        AnyChannels::sort(channels.into_iter().collect()),
    );
    let image = ExrImage::from_layer(layer);
    write_atomically(path, |writer| Ok(image.write().to_buffered(writer)?))
}

fn half(value: f32) -> f16 {
    f16::from_f32(value.clamp(-65504.0, 65504.0))
}

/// Reads one channel of an OpenEXR file: width, height and the values, `[height * width]`.
pub fn read_exr_channel(path: &Path, name: &str) -> Result<(u32, u32, Vec<f32>)> {
    let read = || -> Result<_> {
        let layer = FlatLayer::read(path)?;
        let Some(values) = layer.channel(name) else {
            bail!("expected a channel {name}, found {}", layer.names());
        };
        Ok((layer.width, layer.height, values))
    };
    read().with_context(|| format!("reading {}", path.display()))
}

pub(super) fn header(path: &Path) -> Result<Header> {
    let meta = MetaData::read_from_buffered(BufReader::new(File::open(path)?), false)?;
    let first = meta.headers.first().context("the file has no layer")?;
    let (width, height) = size(first.shared_attributes.display_window)?;
    let is_alpha = |name: String| name == "A" || name.ends_with(".A");
    Ok(Header {
        width,
        height,
        has_alpha: (first.channels.list.iter()).any(|channel| is_alpha(channel.name.to_string())),
        is_hdr: true,
    })
}

pub(super) fn load(path: &Path) -> Result<Image> {
    let layer = FlatLayer::read(path)?;
    let grey = layer.channel("Y");
    let color = |name| {
        let found = layer.channel(name).or_else(|| grey.clone());
        found.with_context(|| {
            format!(
                "expected the channels R, G and B, found {}; export the beauty pass as RGB",
                layer.names()
            )
        })
    };
    let (red, green, blue) = (color("R")?, color("G")?, color("B")?);
    let alpha = layer.channel("A");
    let has_alpha = alpha.is_some();
    let alpha = alpha.unwrap_or_else(|| vec![1.0; red.len()]);
    let pixels = (0..red.len())
        .map(|i| {
            let [r, g, b] = [red[i], green[i], blue[i]].map(finite);
            [r, g, b, finite(alpha[i]).clamp(0.0, 1.0)]
        })
        .collect();
    Ok(Image { width: layer.width, height: layer.height, pixels: Pixels::Linear(pixels), has_alpha })
}

/// Path tracers leave single infinite or undefined pixels, which would spoil a whole training run:
/// undefined becomes black, infinite the largest half.
fn finite(value: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(-65504.0, 65504.0) }
}

fn size(window: IntegerBounds) -> Result<(u32, u32)> {
    let (width, height) = (window.size.0, window.size.1);
    ensure!(
        (1..=1 << 16).contains(&width) && (1..=1 << 16).contains(&height),
        "expected an image of 1 to 65536 pixels a side, found {width}x{height}"
    );
    Ok((width as u32, height as u32))
}

/// The first layer of a file, on its display window.
struct FlatLayer {
    width: u32,
    height: u32,
    /// Where the stored pixels start on the display window.
    offset: Vec2<i32>,
    layer: Layer<AnyChannels<FlatSamples>>,
}

impl FlatLayer {
    fn read(path: &Path) -> Result<Self> {
        // Refuses absurd sizes before memory is asked for them.
        header(path)?;
        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_buffered(BufReader::new(File::open(path)?))?;
        let window = image.attributes.display_window;
        let (width, height) = size(window)?;
        Ok(Self {
            width,
            height,
            offset: image.layer_data.attributes.layer_position - window.position,
            layer: image.layer_data,
        })
    }

    /// The values of a channel, named exactly or as the last part of a dotted name; 0 where the display
    /// window has no stored pixels.
    fn channel(&self, name: &str) -> Option<Vec<f32>> {
        let list = &self.layer.channel_data.list;
        let suffix = format!(".{name}");
        let channel = (list.iter().find(|channel| channel.name.eq(name)))
            .or_else(|| (list.iter()).find(|c| c.name.to_string().ends_with(&suffix)))?;
        if channel.sampling != Vec2(1, 1) {
            return None;
        }
        let stored: Vec<f32> = channel.sample_data.values_as_f32().collect();
        let (width, height) = (self.width as usize, self.height as usize);
        if self.offset == Vec2(0, 0) && self.layer.size == Vec2(width, height) {
            return Some(stored);
        }
        let mut values = vec![0.0; width * height];
        for (index, value) in stored.into_iter().enumerate() {
            let x = (index % self.layer.size.0) as i64 + i64::from(self.offset.0);
            let y = (index / self.layer.size.0) as i64 + i64::from(self.offset.1);
            if (0..width as i64).contains(&x) && (0..height as i64).contains(&y) {
                values[y as usize * width + x as usize] = value;
            }
        }
        Some(values)
    }

    fn names(&self) -> String {
        let channels = self.layer.channel_data.list.iter();
        let names: Vec<_> = channels.map(|channel| channel.name.to_string()).collect();
        names.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip_with_depth() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("view.exr");
        let color: Vec<[f32; 4]> = (0..6).map(|i| [i as f32, 0.5, 1e4, 0.25]).collect();
        let depth = [0.1, 1.0 / 3.0, 70000.5, 0.0, 5.0, 6.0];
        for precision in [Precision::Float, Precision::Half] {
            let pixels = ExrPixels { color: &color, depth: Some(&depth) };
            write_exr(&path, 3, 2, &pixels, precision).expect("writable");
            let image = Image::load(&path).expect("readable");
            assert_eq!((image.width, image.height), (3, 2));
            assert!(image.is_hdr() && image.has_alpha);
            assert_eq!(image.pixels, Pixels::Linear(color.clone()));
            let z = read_exr_channel(&path, "Z").expect("has depth");
            assert_eq!(z, (3, 2, depth.to_vec()));
            let header = Header::read(&path).expect("readable");
            assert!(header.is_hdr && header.has_alpha && header.width == 3);
        }
        let missing = read_exr_channel(&path, "N").expect_err("no such channel");
        assert!(format!("{missing:#}").contains("found A, B, G, R, Z"));
    }

    #[test]
    fn non_finite_pixels_and_missing_alpha_are_repaired() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("fireflies.exr");
        let channel = |name, values: [f32; 2]| AnyChannel::new(name, FlatSamples::F32(values.to_vec()));
        let channels = [
            channel("L.B", [f32::NAN, 1.0]),
            channel("L.G", [f32::INFINITY, 2.0]),
            channel("L.R", [0.5, -3.0]),
        ];
        ExrImage::from_channels((2, 1), AnyChannels::sort(channels.into_iter().collect()))
            .write()
            .to_file(&path)
            .expect("writable");
        let image = Image::load(&path).expect("readable");
        let expected = vec![[0.5, 65504.0, 0.0, 1.0], [-3.0, 2.0, 1.0, 1.0]];
        assert_eq!(image.pixels, Pixels::Linear(expected));
        assert!(!image.has_alpha);
    }
}
