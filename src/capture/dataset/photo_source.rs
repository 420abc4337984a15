//! One frame's pixels: decoded, masked, turned, cropped and reduced to the size of its camera.

use anyhow::{Result, ensure};

use super::sidecars::Sidecars;
use super::{Dataset, Frame, prefetch};
use crate::capture::image_file::{ColorKey, Multiplied, Turn, Window, crop, nearest, reduce_any};
use crate::photo::{AlphaMode, Photo, Reading};
use crate::photo::{BitDepth, Image};

/// Where a frame's pixels come from.
#[derive(Clone, Debug)]
pub(super) struct PhotoSource {
    /// Width and height of the image file, in pixels.
    pub(super) stored: [u32; 2],
    /// How the stored image is turned.
    pub(super) turn: Option<Turn>,
    /// The part of the turned image that is used.
    pub(super) window: Window,
    pub(super) sidecars: Sidecars,
    /// The colours of the image that are transparent.
    pub(super) color_key: ColorKey,
}

/// What all frames of a dataset are read alike by.
#[derive(Clone, Copy, Debug)]
pub(super) struct How {
    /// The depth of the dataset's finest image.
    pub(super) bits: BitDepth,
    pub(super) multiplied: Multiplied,
    pub(super) invert_masks: bool,
}

impl How {
    pub(super) fn new(bits: BitDepth, reading: &Reading) -> Self {
        let multiplied = match (reading.alpha, bits) {
            (AlphaMode::Straight, _) => Multiplied::Straight,
            (AlphaMode::Auto, BitDepth::Eight | BitDepth::Sixteen) => Multiplied::Straight,
            (AlphaMode::Premultiplied, _) | (AlphaMode::Auto, BitDepth::Float) => Multiplied::Premultiplied,
        };
        Self { bits, multiplied, invert_masks: reading.invert_masks }
    }
}

impl Dataset {
    /// Decodes one frame, with its depth if `depth` and if there is any.
    ///
    /// # Errors
    /// When a file cannot be read, is damaged, or has changed since the dataset was opened; the message names it.
    pub fn load(&self, index: usize, depth: bool) -> Result<Photo> {
        let frame = &self.frames[index];
        let reach = depth.then(|| self.reach(frame));
        frame.load(How::new(self.bit_depth, &self.reading), reach)
    }

    /// Decodes frames in parallel and hands them over one at a time, in their order, with their position in
    /// `indices`. At any time so many photos are being decoded or wait as rayon has threads, and one is handed
    /// over, but no more than fit into a gigabyte unless a single one does not.
    ///
    /// # Errors
    /// As [`Dataset::load`], and those of `each`; nothing is handed over after the first.
    pub fn stream(
        &self,
        indices: &[usize],
        depth: bool,
        each: &mut dyn FnMut(usize, Photo) -> Result<()>,
    ) -> Result<()> {
        let bytes: Vec<_> = indices.iter().map(|&index| self.frames[index].decoding_bytes(depth)).collect();
        prefetch::prefetch(&bytes, &|position| self.load(indices[position], depth), each)
    }

    /// Most bytes of host memory that [`Dataset::stream`] takes for these frames.
    pub fn stream_bytes(&self, indices: &[usize], depth: bool) -> u64 {
        let largest = indices.iter().map(|&index| self.frames[index].decoding_bytes(depth)).max();
        prefetch::most_bytes(indices.len(), largest.unwrap_or(0))
    }
}

impl Frame {
    /// Decodes the photo, with the depth up to somewhat beyond `reach` world units if that is asked for.
    fn load(&self, how: How, reach: Option<f64>) -> Result<Photo> {
        let size = [self.camera.width, self.camera.height];
        let mut image = self.upright(how)?.cropped(self.source.window);
        if how.bits == BitDepth::Sixteen {
            image = image.in_16_bits();
        }
        if image.size() != size {
            image = image.reduced(size);
        }
        let ignored = self.ignored(how.invert_masks)?;
        let (depth, far_depth) = match (&self.source.sidecars.depth, reach) {
            (Some(file), Some(reach)) => {
                self.depth(file.load(self.source.stored, self.source.upright_size())?, reach)
            }
            _ => (Vec::new(), 0.0),
        };
        Ok(Photo { image, ignored, depth, far_depth })
    }

    /// The whole picture, turned, as its pixels are to be understood.
    pub(super) fn upright(&self, how: How) -> Result<Image> {
        let PhotoSource { stored, turn, sidecars, .. } = &self.source;
        let mut image = Image::load(&self.path)?;
        let show = self.path.display();
        ensure!(
            image.size() == *stored,
            "{show} had {}x{} pixels when the dataset was opened and has {}x{} now; start again",
            stored[0],
            stored[1],
            image.width,
            image.height
        );
        if image.has_alpha {
            image = image.reinterpreted(how.multiplied);
        }
        // The colours of a linear file with alpha of its own are multiplied with that one.
        if let Some(path) = sidecars.alpha.as_ref().filter(|_| !(image.has_alpha && image.is_hdr())) {
            let alpha = Image::load(path)?;
            image = image.with_alpha(&nearest(&alpha.red(), alpha.size(), *stored));
        }
        let image = image.keyed(self.source.color_key);
        Ok(match turn {
            Some(turn) => image.turned(*turn),
            None => image,
        })
    }

    /// Pixels that a mask ignores, at the camera's size; empty if there are none.
    fn ignored(&self, invert: bool) -> Result<Vec<bool>> {
        let mut all: Vec<bool> = Vec::new();
        for mask in &self.source.sidecars.masks {
            let (size, ignored) = mask.ignored(invert)?;
            let ignored = self.fitted(ignored, size);
            if all.is_empty() {
                all = ignored;
            } else {
                all.iter_mut().zip(ignored).for_each(|(all, one)| *all |= one);
            }
        }
        if !all.contains(&true) {
            return Ok(Vec::new());
        }
        Ok(reduce_any(&all, self.source.window.size, [self.camera.width, self.camera.height]))
    }

    /// The values of a sidecar of `size` on the part of the picture that is used.
    pub(super) fn fitted<T: Copy>(&self, values: Vec<T>, size: [u32; 2]) -> Vec<T> {
        let PhotoSource { stored, turn, window, .. } = &self.source;
        let is_wide = |[width, height]: [u32; 2]| width > height;
        // One that was made of the turned picture needs no turn.
        let (values, size) = match turn.filter(|_| is_wide(size) == is_wide(*stored)) {
            Some(turn) => (turn.apply(&values, size), turn.size(size)),
            None => (values, size),
        };
        let upright = self.source.upright_size();
        crop(&nearest(&values, size, upright), upright, *window)
    }

    /// Most bytes that loading takes, the photo included.
    fn decoding_bytes(&self, with_depth: bool) -> u64 {
        let PhotoSource { stored, sidecars, .. } = &self.source;
        let image = self.bits.decoding_bytes_per_pixel();
        // Beside the decoded picture: a decoded sidecar, a number for each of its pixels, and that at the
        // picture's size.
        let mask = if sidecars.masks.is_empty() { 0 } else { 8 };
        let depth = if with_depth && sidecars.depth.is_some() { 16 } else { 0 };
        u64::from(stored[0]) * u64::from(stored[1]) * (image + mask + depth)
    }
}

impl PhotoSource {
    /// Width and height of the turned picture.
    pub(super) fn upright_size(&self) -> [u32; 2] {
        self.turn.map_or(self.stored, |turn| turn.size(self.stored))
    }
}
