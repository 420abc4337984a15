//! The depth of a frame: from its file to world units, without what stands for far away.

use std::path::PathBuf;

use anyhow::{Context, Result, anyhow};

use super::listing::DepthScale;
use super::{Dataset, Frame};
use crate::capture::image_file::{DepthMap, load_depth, reduce_depth};

/// Depth beyond the farthest corner of the scene box by this factor is that of no surface.
const FAR: f64 = 2.0;
/// A value beyond that corner that so many parts of a file have, and at least so many pixels, is a stand-in
const MANY: usize = 200;
const AT_LEAST: usize = 8;
/// if what is next to it is nearer by this factor.
const GAP: f32 = 1.5;
/// Most that the aspects of photo and depth may differ by, beside a pixel of rounding.
const ASPECT: f64 = 0.05;

/// A depth map's file.
#[derive(Clone, Debug)]
pub(super) struct DepthFile {
    pub(super) path: PathBuf,
    pub(super) scale: DepthScale,
}

/// Depth in world units, as its file has it.
#[derive(Clone, Debug)]
pub(super) struct RawDepth {
    size: [u32; 2],
    /// 0 where it is unknown, infinite where the file says so.
    values: Vec<f32>,
    /// World units per unit of the file.
    scale: f64,
    is_8_bit: bool,
}

/// The depth of one frame, `[height * width]` of its camera, in world units.
#[derive(Clone, Debug)]
pub(crate) struct FrameDepth {
    /// As it is trained on: 0 where it is unknown.
    pub(crate) known: Vec<f32>,
    /// The same before values were compared with the scene box: 0 where it is unknown or infinite.
    pub(crate) unlimited: Vec<f32>,
    /// Part of the file's values that stand for far away.
    pub(crate) far: f64,
    /// World units per unit of the file.
    pub(crate) scale: f64,
    /// Whether the file has 8 bits.
    pub(crate) is_8_bit: bool,
}

impl Dataset {
    /// The depth of one frame that has a file of it.
    ///
    /// # Errors
    /// When training on it would fail: the file cannot be read or does not fit the photo.
    pub(crate) fn load_depth(&self, index: usize) -> Result<FrameDepth> {
        let frame = &self.frames[index];
        let file = frame.source.sidecars.depth.as_ref().context("the frame has no depth file")?;
        let raw = file.load(frame.source.stored, frame.source.upright_size())?;
        let mut unlimited = raw.clone();
        for value in unlimited.values.iter_mut().filter(|value| value.is_infinite()) {
            *value = 0.0;
        }
        let (scale, is_8_bit) = (raw.scale, raw.is_8_bit);
        let (known, far) = frame.depth(raw, self.reach(frame));
        Ok(FrameDepth { known, unlimited: frame.at_its_size(unlimited), far, scale, is_8_bit })
    }

    /// The depth file of a frame, relative to the dataset's folder where it lies in it.
    pub(crate) fn depth_name(&self, index: usize) -> String {
        let path = self.frames[index].source.sidecars.depth.as_ref().map(|file| file.path.as_path());
        let path = path.unwrap_or(std::path::Path::new(""));
        path.strip_prefix(&self.root).unwrap_or(path).display().to_string()
    }

    /// Distance from a frame's camera to the farthest corner of the scene box, in world units.
    pub(super) fn reach(&self, frame: &Frame) -> f64 {
        let off = (frame.camera.position() - self.bounds.center).abs();
        (off + self.bounds.outer_half()).length()
    }
}

impl DepthFile {
    /// Reads the file that belongs to a photo of this size, or of the other one when it is turned.
    pub(super) fn load(&self, photo: [u32; 2], turned: [u32; 2]) -> Result<RawDepth> {
        let DepthMap { width, height, values, is_integer, is_8_bit } = load_depth(&self.path)?;
        let reading = || format!("reading {}", self.path.display());
        let size = [width, height];
        if !is_alike(size, photo) && !is_alike(size, turned) {
            let [across, down] = photo;
            let found = format!("expected the aspect of its photo, {across}x{down}, found {width}x{height}");
            return Err(anyhow!("{found}; export depth for the whole photo, at any size").context(reading()));
        }
        let unstated =
            "its whole numbers mean nothing, as no `integer_depth_scale` says how long a step is; state it";
        let scale = if is_integer { self.scale.steps } else { Some(self.scale.lengths) };
        let scale = scale.context(unstated).with_context(reading)?;
        let known = |depth: f32| {
            let depth = (f64::from(depth) * scale) as f32;
            if depth > 0.0 { depth } else { 0.0 }
        };
        Ok(RawDepth { size, values: values.into_iter().map(known).collect(), scale, is_8_bit })
    }
}

impl Frame {
    /// Depth at the camera's size, unknown where it stands for far away, and the part of the values that do.
    pub(super) fn depth(&self, mut raw: RawDepth, reach: f64) -> (Vec<f32>, f64) {
        let far = forget_far(&mut raw.values, reach);
        let part = far as f64 / raw.values.len() as f64;
        (self.at_its_size(raw), part)
    }

    /// Depth at the camera's size, in world units, before there is a scene box: 0 where it is unknown, infinite or larger
    /// where it stands for far away; empty without a file.
    ///
    /// # Errors
    /// As [`Dataset::load_depth`].
    pub(super) fn unlimited_depth(&self) -> Result<Vec<f32>> {
        let Some(file) = &self.source.sidecars.depth else { return Ok(Vec::new()) };
        Ok(self.at_its_size(file.load(self.source.stored, self.source.upright_size())?))
    }

    fn at_its_size(&self, raw: RawDepth) -> Vec<f32> {
        let depth = self.fitted(raw.values, raw.size);
        reduce_depth(&depth, self.source.window.size, [self.camera.width, self.camera.height])
    }
}

/// Whether two sizes have one aspect, up to rounding.
fn is_alike(a: [u32; 2], b: [u32; 2]) -> bool {
    let [aw, ah, bw, bh] = [a[0], a[1], b[0], b[1]].map(f64::from);
    (aw * bh - ah * bw).abs() <= ASPECT * (aw * bh).min(ah * bw) + bw.max(bh)
}

/// Makes depth unknown (0) where it stands for far away, as seen from a camera whose farthest corner of the scene box is at
/// `reach`: infinite values, those beyond the box by far, and one that much of the map has, beyond the box and all else.
/// Returns how many there were.
fn forget_far(values: &mut [f32], reach: f64) -> usize {
    let limit = (FAR * reach) as f32;
    let near = || values.iter().copied().filter(|value| *value <= limit);
    let greatest = near().fold(0.0, f32::max);
    let next = near().filter(|value| *value < greatest).fold(0.0, f32::max);
    let is_alone = greatest > reach as f32
        && next * GAP < greatest
        && near().filter(|value| *value == greatest).count() >= AT_LEAST.max(values.len() / MANY);
    let mut far = 0;
    for value in values {
        if *value > limit || (is_alone && *value == greatest) {
            *value = 0.0;
            far += 1;
        }
    }
    far
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stand_ins_for_far_away_are_unknown() {
        let far = |values: &[f32]| {
            let mut values = values.to_vec();
            (forget_far(&mut values, 10.0), values)
        };
        assert_eq!(far(&[1.0, 1e10, f32::INFINITY, 0.0, 19.0]), (2, vec![1.0, 0.0, 0.0, 0.0, 19.0]));
        let sky = [&[3.0, 4.0, 6.0][..], &[15.0; 8]].concat();
        assert_eq!(far(&sky).0, 8, "a clipping plane");
        assert_eq!(far(&sky[..10]).0, 0, "few");
        let wall = [&[3.0, 4.0, 6.0][..], &[9.0; 8]].concat();
        assert_eq!(far(&wall).0, 0, "a wall within the box");
        let plane = [&[3.0, 4.0, 14.0][..], &[15.0; 8]].concat();
        assert_eq!(far(&plane).0, 0, "and one that goes on");
        assert_eq!(far(&[]), (0, vec![]));
    }

    #[test]
    fn aspects_are_alike_up_to_rounding() {
        for (a, b) in
            [([256, 192], [1920, 1440]), ([640, 480], [1296, 968]), ([3, 2], [12, 8]), ([5, 3], [12, 8])]
        {
            assert!(is_alike(a, b), "{a:?} {b:?}");
        }
        for (a, b) in [([48, 64], [64, 48]), ([64, 64], [64, 48]), ([512, 424], [1920, 1080])] {
            assert!(!is_alike(a, b), "{a:?} {b:?}");
        }
    }
}
