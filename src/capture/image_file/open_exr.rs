//! OpenEXR files: channels found by name, half or float, written with colour, alpha and depth.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use ::exr::meta::MetaData;
use ::exr::meta::header::Header as Part;
use ::exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image as ExrImage, Layer, LayerAttributes,
    ReadChannels, ReadLayers, ReadSpecificChannel, Text, Vec2, WritableImage, f16, read,
};
use anyhow::{Context, Result};

use super::{Header, check_count, check_size, of_file};
use crate::photo::{BitDepth, Image, Pixels};
use crate::support::file::write_atomically;

/// Said of what the decoder does not take.
const DAMAGED: &str = "the file is damaged or incomplete, or uses a rare variant of its format; copy it again, or \
                       export it again";

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
///
/// # Errors
/// When the file cannot be read or lacks the channel.
pub fn read_exr_channel(path: &Path, name: &str) -> Result<(u32, u32, Vec<f32>)> {
    of_file(path, || read_one(path, &[name]))
}

/// The channel of an OpenEXR file that holds depth.
pub(super) fn load_depth(path: &Path) -> Result<(u32, u32, Vec<f32>)> {
    let parts = parts(path)?;
    let only = match &parts[..] {
        [part] if part.channels.list.len() == 1 => part.channels.list[0].name.to_string(),
        _ => String::from("Z"),
    };
    read_one(path, &["Z", "V", "Y", "R", &only])
}

/// Width, height and the values of the first of these channels that there is.
fn read_one(path: &Path, names: &[&str]) -> Result<(u32, u32, Vec<f32>)> {
    let parts = parts(path)?;
    let found = names.iter().find_map(|name| find(&parts, &[name]));
    let Some((part, channels)) = found else {
        let wanted = names.first().copied().unwrap_or_default();
        anyhow::bail!("expected a channel {wanted}, found {}", names_of(&parts));
    };
    let window = Display::of(part)?;
    let create = move |_: Vec2<usize>, _: &_| window.canvas(0.0);
    let set = move |values: &mut Vec<f32>, at: Vec2<usize>, (value,): (f32,)| window.set(values, at, value);
    let channels = read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required::<f32>(channels[0].clone())
        .collect_pixels(create, set);
    let image = channels
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(reader(path)?)
        .context(DAMAGED)?;
    Ok((window.size[0], window.size[1], image.layer_data.channel_data.pixels))
}

pub(super) fn header(path: &Path) -> Result<Header> {
    let parts = parts(path)?;
    let (part, channels) = color_channels(&parts)?;
    let [width, height] = Display::of(part)?.size;
    let has_alpha = part.channels.list.iter().any(|channel| channel.name == channels[3]);
    Ok(Header { width, height, has_alpha, bits: BitDepth::Float, orientation: None })
}

pub(super) fn load(path: &Path) -> Result<Image> {
    let parts = parts(path)?;
    let (part, [red, green, blue, alpha]) = color_channels(&parts)?;
    let has_alpha = part.channels.list.iter().any(|channel| channel.name == alpha);
    let window = Display::of(part)?;
    let outside = [0.0, 0.0, 0.0, if has_alpha { 0.0 } else { 1.0 }];
    let layers = read().no_deep_data().largest_resolution_level().specific_channels();
    let file = reader(path)?;
    // The crate's reader takes every channel once.
    let pixels = if red == green {
        let create = move |_: Vec2<usize>, _: &_| window.canvas(outside);
        let set = move |pixels: &mut Vec<[f32; 4]>, at: Vec2<usize>, (grey, alpha): (f32, f32)| {
            window.set(pixels, at, repaired([grey, grey, grey, alpha]));
        };
        let channels = layers.required::<f32>(red).optional(alpha, 1.0_f32).collect_pixels(create, set);
        let image = channels
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(file)
            .context(DAMAGED)?;
        image.layer_data.channel_data.pixels
    } else {
        let create = move |_: Vec2<usize>, _: &_| window.canvas(outside);
        let set = move |pixels: &mut Vec<[f32; 4]>, at: Vec2<usize>, (r, g, b, a): (f32, f32, f32, f32)| {
            window.set(pixels, at, repaired([r, g, b, a]));
        };
        let channels = layers.required::<f32>(red).required::<f32>(green).required::<f32>(blue);
        let channels = channels.optional(alpha, 1.0_f32).collect_pixels(create, set);
        let image = channels
            .first_valid_layer()
            .all_attributes()
            .non_parallel()
            .from_buffered(file)
            .context(DAMAGED)?;
        image.layer_data.channel_data.pixels
    };
    let [width, height] = window.size;
    Ok(Image { width, height, pixels: Pixels::Linear(pixels), has_alpha })
}

fn repaired([r, g, b, alpha]: [f32; 4]) -> [f32; 4] {
    [finite(r), finite(g), finite(b), finite(alpha).clamp(0.0, 1.0)]
}

/// Path tracers leave single infinite or undefined pixels, which would spoil a whole training run:
/// undefined becomes black, infinite the largest half.
pub(super) fn finite(value: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(-65504.0, 65504.0) }
}

fn reader(path: &Path) -> Result<BufReader<File>> {
    Ok(BufReader::new(File::open(path)?))
}

/// The parts of a file, which the crate calls layers, with sizes that are worth decoding.
fn parts(path: &Path) -> Result<Vec<Part>> {
    let parts = MetaData::read_from_buffered(reader(path)?, false).context(DAMAGED)?.headers;
    for part in &parts {
        check_size(part.layer_size.0 as u64, part.layer_size.1 as u64)?;
    }
    Ok(parts.into_iter().collect())
}

/// The first part that has all these channels at full resolution, and their names: exact, or as the last part
/// of a dotted name, all of the same layer.
fn find<'a>(parts: &'a [Part], names: &[&str]) -> Option<(&'a Part, Vec<Text>)> {
    let flat = parts.iter().filter(|part| !part.deep);
    flat.into_iter().find_map(|part| {
        let full = || part.channels.list.iter().filter(|channel| channel.sampling == Vec2(1, 1));
        let first = names.first()?;
        let layer = |name: String| name.strip_suffix(first).map(str::to_owned);
        let is_layer = |prefix: &String| prefix.is_empty() || prefix.ends_with('.');
        let mut layers: Vec<_> =
            full().filter_map(|channel| layer(channel.name.to_string())).filter(is_layer).collect();
        // The unnamed layer first.
        layers.sort_by_key(|prefix| !prefix.is_empty());
        layers.into_iter().find_map(|prefix| {
            let named = |name: &&str| {
                let name = format!("{prefix}{name}");
                full().find(|channel| channel.name.to_string() == name).map(|channel| channel.name.clone())
            };
            Some((part, names.iter().map(named).collect::<Option<Vec<_>>>()?))
        })
    })
}

/// Red, green, blue and alpha, whether or not there is alpha; grey stands for all three colours.
fn color_channels(parts: &[Part]) -> Result<(&Part, [Text; 4])> {
    let color = find(parts, &["R", "G", "B"]).or_else(|| {
        let (part, grey) = find(parts, &["Y"])?;
        Some((part, vec![grey[0].clone(); 3]))
    });
    let (part, color) = color.with_context(|| {
        format!(
            "expected the channels R, G and B, found {}; export the beauty pass as RGB at full resolution",
            names_of(parts)
        )
    })?;
    let [red, green, blue] = &color[..] else { anyhow::bail!("expected three colours") };
    let name = red.to_string();
    let prefix = name.rsplit_once('.').map_or(String::new(), |(layer, _)| format!("{layer}."));
    let alpha = Text::new_or_none(format!("{prefix}A")).context("a channel's name is not text")?;
    Ok((part, [red.clone(), green.clone(), blue.clone(), alpha]))
}

fn names_of(parts: &[Part]) -> String {
    let channels = parts.iter().flat_map(|part| &part.channels.list);
    let names: Vec<_> = channels.map(|channel| channel.name.to_string()).collect();
    names.join(", ")
}

/// The window to show, and where the stored pixels start on it.
#[derive(Clone, Copy)]
struct Display {
    size: [u32; 2],
    offset: [i64; 2],
}

impl Display {
    fn of(part: &Part) -> Result<Self> {
        let window = part.shared_attributes.display_window;
        let (width, height) = (window.size.0 as u64, window.size.1 as u64);
        check_size(width, height)?;
        let (stored, shown) = (part.own_attributes.layer_position, window.position);
        let offset = [(stored.0, shown.0), (stored.1, shown.1)];
        let offset = offset.map(|(stored, shown)| i64::from(stored) - i64::from(shown));
        Ok(Self { size: [width as u32, height as u32], offset })
    }

    fn canvas<T: Clone>(self, value: T) -> Vec<T> {
        vec![value; self.size[0] as usize * self.size[1] as usize]
    }

    /// Sets the pixel that is stored at `at`, unless it lies outside.
    fn set<T>(self, values: &mut [T], at: Vec2<usize>, value: T) {
        let (x, y) = (at.0 as i64 + self.offset[0], at.1 as i64 + self.offset[1]);
        let [width, height] = self.size.map(i64::from);
        if (0..width).contains(&x) && (0..height).contains(&y) {
            values[(y * width + x) as usize] = value;
        }
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
            assert!(header.bits == BitDepth::Float && header.has_alpha && header.width == 3);
        }
        let missing = read_exr_channel(&path, "N").expect_err("no such channel");
        assert!(format!("{missing:#}").contains("found A, B, G, R, Z"));
    }

    #[test]
    fn damaged_files_are_told_with_the_remedy() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("half.exr");
        let color: Vec<[f32; 4]> = (0..4096).map(|i| [(i * i % 97) as f32, 0.5, i as f32, 1.0]).collect();
        let pixels = ExrPixels { color: &color, depth: None };
        write_exr(&path, 64, 64, &pixels, Precision::Float).expect("writable");
        let whole = std::fs::read(&path).expect("readable");
        for length in [16, whole.len() / 2] {
            std::fs::write(&path, &whole[..length]).expect("writable");
            let errors = [Image::load(&path).err(), read_exr_channel(&path, "R").err()];
            for error in errors.map(|error| format!("{:#}", error.expect("is cut short"))) {
                assert!(error.contains("half.exr: the file is damaged") && error.contains("export it again"));
            }
        }
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
