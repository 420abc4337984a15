//! What depth files look like: whether they can be read, how much they tell, and whether their units are those of the poses.

mod scale;

use super::{Diagnostic, Spread};
use crate::camera::Camera;
use crate::capture::dataset::Dataset;
use crate::capture::diagnostics::{NO_DEPTH_KNOWN, Severity};
use crate::capture::image_file::reduce_depth;
use crate::photo::Photo;
use crate::photo::color_space::photo_over;
use crate::support::format::{count, few, length, percent, plural};
use crate::support::statistics::median;
use glam::DVec2;
use rayon::iter::{Either, IntoParallelRefIterator, ParallelIterator};
use scale::{Agreement, Group};
use std::collections::{HashMap, HashSet};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Cells along the longer side at which views are compared.
const CELLS: u32 = 160;
/// Beyond the median by this factor no depth is compared: it stands for far away, whatever the units.
const FAR: f32 = 100.0;
/// Depth that is off by less than this factor is in the right units,
const OFF: f64 = 1.1;
/// and for less agreement than this nothing is known about them,
const AGREE: f64 = 0.25;
/// or where as it is there is more than this part of it.
const AS_WELL: f64 = 0.5;
/// Where more of it agrees, depth is not inverse;
const CLEARLY: f64 = 0.6;
/// it is where so many times as much of its inverse does.
const OFTEN: f64 = 1.5;
/// Depth in the middle that differs by this factor from the distance to what the cameras look at.
const OFF_FOCUS: f64 = 4.0;

/// Depth and colours of a small version of a photo, to compare with others.
#[derive(Clone, Debug)]
struct Sample {
    camera: Camera,
    /// In world units, as far as the scale of the files is right; 0 where it is unknown.
    depth: Vec<f32>,
    colors: Vec<[f32; 3]>,
}

/// What matters about the depth of one frame.
#[derive(Clone, Debug)]
pub struct DepthLook {
    /// Part of the photo's pixels whose depth is known.
    pub known: f64,
    /// Part of the file's values that stand for far away.
    pub far: f64,
    /// Known depth, in world units.
    pub range: Spread,
    is_8_bit: bool,
    /// World units per unit of the file.
    scale: f64,
    /// Of those that are compared.
    sample: Option<Sample>,
}

/// The depth of all frames that have some.
#[derive(Clone, Debug, Default)]
pub struct DepthSurvey {
    /// Indices of frames, and what their files tell.
    pub looks: Vec<(usize, DepthLook)>,
    /// Indices of frames whose files cannot be used, and why.
    pub failures: Vec<(usize, String)>,
    /// Frames that are compared.
    groups: Vec<Group>,
}

impl DepthLook {
    /// Reads the depth file of a frame that has one, and its photo if it is to be compared.
    fn of(dataset: &Dataset, index: usize, is_compared: bool) -> anyhow::Result<Self> {
        let depth = dataset.load_depth(index)?;
        let known = || depth.known.iter().filter(|depth| **depth > 0.0).map(|depth| f64::from(*depth));
        let photo = if is_compared { dataset.load(index, false).ok() } else { None };
        Ok(Self {
            known: known().count() as f64 / depth.known.len() as f64,
            far: depth.far,
            range: Spread::of(known()),
            is_8_bit: depth.is_8_bit,
            scale: depth.scale,
            sample: photo.map(|photo| Sample::of(&dataset.frames[index].camera, photo, depth.unlimited)),
        })
    }
}

/// All frames of some groups.
fn compared(groups: &[Group]) -> HashSet<usize> {
    groups.iter().flat_map(|(anchor, others)| others.iter().chain([anchor])).copied().collect()
}

/// Why a file cannot be used, without its name.
fn reason(error: &anyhow::Error) -> String {
    let causes = error.chain().map(ToString::to_string).filter(|cause| !cause.starts_with("reading "));
    causes.collect::<Vec<_>>().join(": ")
}

impl Sample {
    fn of(camera: &Camera, photo: Photo, mut depth: Vec<f32>) -> Self {
        let size = photo.image.size();
        let by = f64::from(CELLS) / f64::from(size[0].max(size[1]));
        let small = size.map(|side| ((f64::from(side) * by.min(1.0)).round() as u32).max(1));
        let limit = FAR * Spread::of(depth.iter().filter(|z| **z > 0.0).map(|z| f64::from(*z))).median as f32;
        depth.iter_mut().filter(|depth| **depth > limit).for_each(|depth| *depth = 0.0);
        for (depth, _) in depth.iter_mut().zip(&photo.ignored).filter(|(_, ignored)| **ignored) {
            *depth = 0.0;
        }
        Self {
            camera: camera.resized(small[0], small[1]),
            depth: reduce_depth(&depth, size, small),
            colors: photo_over(&photo.image.reduced(small), [0.0; 3]),
        }
    }

    /// The same where the files have inverse depth.
    fn inverted(&self) -> Self {
        let invert = |depth: &f32| if *depth > 0.0 { depth.recip() } else { 0.0 };
        Self { depth: self.depth.iter().map(invert).collect(), ..self.clone() }
    }

    /// Places in the picture, with known depth and colour there.
    fn known(&self) -> impl Iterator<Item = (DVec2, f64, [f32; 3])> {
        let place = |index: usize| {
            let pixel = [index as u32 % self.camera.width, index as u32 / self.camera.width];
            DVec2::from(pixel.map(f64::from)) + 0.5
        };
        let values = self.depth.iter().zip(&self.colors).enumerate().filter(|(_, (depth, _))| **depth > 0.0);
        values.map(move |(index, (depth, color))| (place(index), f64::from(*depth), *color))
    }

    /// Depth and colour at a place in the picture, where depth is known.
    fn at(&self, place: DVec2) -> Option<(f64, [f32; 3])> {
        let [width, height] = [self.camera.width, self.camera.height].map(f64::from);
        let is_within = (0.0..width).contains(&place.x) && (0.0..height).contains(&place.y);
        let index = is_within.then(|| place.y as usize * self.camera.width as usize + place.x as usize)?;
        (self.depth[index] > 0.0).then(|| (f64::from(self.depth[index]), self.colors[index]))
    }

    /// Median depth in the middle of the picture.
    fn middle(&self) -> Option<f64> {
        let [width, height] = [self.camera.width, self.camera.height].map(|side| side as usize);
        let rows = self.depth.chunks_exact(width).skip(height / 3).take(height.div_ceil(3));
        let middle = rows.flat_map(|row| row.iter().skip(width / 3).take(width.div_ceil(3)));
        median(middle.filter(|depth| **depth > 0.0).map(|depth| f64::from(*depth)))
    }
}

impl DepthSurvey {
    /// Reads the depth files of some frames, in parallel, and tells `notice` how many it has read.
    pub fn of(dataset: &Dataset, frames: &[usize], notice: &(dyn Fn(usize) + Sync)) -> Self {
        Self::with(dataset, frames, scale::groups(dataset, frames), notice)
    }

    /// The same of the few frames whose depth is compared.
    #[must_use]
    pub fn of_few(dataset: &Dataset, frames: &[usize]) -> Self {
        let groups = scale::groups(dataset, frames);
        let mut few: Vec<usize> = compared(&groups).into_iter().collect();
        few.sort_unstable();
        Self::with(dataset, &few, groups, &|_| {})
    }

    fn with(
        dataset: &Dataset,
        frames: &[usize],
        groups: Vec<Group>,
        notice: &(dyn Fn(usize) + Sync),
    ) -> Self {
        let compared = compared(&groups);
        let done = AtomicUsize::new(0);
        let look = |&index: &usize| {
            let look = DepthLook::of(dataset, index, compared.contains(&index));
            notice(1 + done.fetch_add(1, Ordering::Relaxed));
            match look {
                Ok(look) => Either::Left((index, look)),
                Err(error) => Either::Right((index, reason(&error))),
            }
        };
        let (looks, failures) = frames.par_iter().partition_map(look);
        Self { looks, failures, groups }
    }

    /// Mean part of the pixels whose depth is known.
    #[must_use]
    pub fn known(&self) -> f64 {
        self.mean(|look| look.known)
    }

    /// Mean part of the files' values that stand for far away.
    #[must_use]
    pub fn far(&self) -> f64 {
        self.mean(|look| look.far)
    }

    fn mean(&self, part: fn(&DepthLook) -> f64) -> f64 {
        let sum = self.looks.iter().fold(0.0, |sum, (_, look)| sum + part(look));
        sum / self.looks.len().max(1) as f64
    }

    /// The least, the typical and the largest known depth, in world units.
    #[must_use]
    pub fn range(&self) -> Spread {
        let telling = || self.looks.iter().map(|(_, look)| look.range).filter(|range| range.max > 0.0);
        Spread {
            min: Spread::of(telling().map(|range| range.min)).min,
            median: Spread::of(telling().map(|range| range.median)).median,
            max: Spread::of(telling().map(|range| range.max)).max,
        }
    }

    /// What stands out. What training on depth would fail for is an error where `is_trained_on`.
    #[must_use]
    pub fn findings(&self, dataset: &Dataset, is_trained_on: bool) -> Vec<Diagnostic> {
        let mut findings = self.failed(dataset, is_trained_on);
        findings.extend(self.coarse_numbers(dataset));
        let train: Vec<_> = self.looks.iter().filter(|(index, _)| dataset.train.contains(index)).collect();
        if !train.is_empty() && train.iter().all(|(_, look)| look.known == 0.0) {
            findings.push(Diagnostic::new(
                if is_trained_on { Severity::Error } else { Severity::Warning },
                NO_DEPTH_KNOWN,
            ));
        }
        findings.extend(self.units(dataset));
        findings
    }

    /// Files that cannot be used, one finding for each reason.
    fn failed(&self, dataset: &Dataset, is_trained_on: bool) -> Vec<Diagnostic> {
        let mut reasons: Vec<(&str, Vec<usize>)> = Vec::new();
        for (index, reason) in &self.failures {
            match reasons.iter_mut().find(|(known, _)| known == reason) {
                Some((_, frames)) => frames.push(*index),
                None => reasons.push((reason, vec![*index])),
            }
        }
        let finding = |(reason, frames): (&str, Vec<usize>)| {
            let fails = is_trained_on && frames.iter().any(|index| dataset.train.contains(index));
            let names: Vec<String> = frames.iter().map(|&index| dataset.depth_name(index)).collect();
            let files = count(frames.len(), "depth file");
            let message = format!("{files} cannot be used ({}): {reason}", few(&names));
            let (severity, message) = match fails {
                true => (Severity::Error, message),
                false => {
                    (Severity::Warning, format!("{message}; training fails where loss.depth is above 0"))
                }
            };
            Diagnostic::new(severity, message).about(frames)
        };
        reasons.into_iter().map(finding).collect()
    }

    fn coarse_numbers(&self, dataset: &Dataset) -> Option<Diagnostic> {
        let coarse = self.looks.iter().filter(|(_, look)| look.is_8_bit);
        let frames: Vec<usize> = coarse.map(|(index, _)| *index).collect();
        let names: Vec<String> = frames.iter().map(|&index| dataset.depth_name(index)).collect();
        (!frames.is_empty()).then(|| {
            Diagnostic::warning(format!(
                "{} {} 8 bits ({}): that is usually a picture of depth for people, near or far in white, and at best \
                 255 steps; export it in 16 bits or floats",
                count(frames.len(), "depth file"),
                plural(frames.len() as u64, "has", "have"),
                few(&names)
            ))
            .about(frames)
        })
    }

    /// Depth whose inverse agrees, where at most `part` of it does as it is.
    fn inverse(&self, samples: &HashMap<usize, &Sample>, part: f64) -> Option<Diagnostic> {
        if part >= CLEARLY {
            return None;
        }
        let inverted: HashMap<usize, Sample> =
            samples.iter().map(|(index, sample)| (*index, sample.inverted())).collect();
        let inverse = scale::agreement(&self.groups, |index| inverted.get(&index))?;
        let scale = self.looks.first()?.1.scale;
        (inverse.part >= AGREE.max(OFTEN * part)).then(|| {
            Diagnostic::warning(format!(
                "depth is probably inverse (disparity): {} of what views see in common has one place and colour at {} / \
                 value, and at most {} at any multiple of the values; if so, export depth itself",
                percent(inverse.part),
                length(inverse.factor / scale),
                percent(part)
            ))
        })
    }

    /// Depth in other units than the poses.
    fn units(&self, dataset: &Dataset) -> Option<Diagnostic> {
        let samples = || self.looks.iter().filter_map(|(index, look)| Some((*index, look.sample.as_ref()?)));
        let by_frame: HashMap<usize, &Sample> = samples().collect();
        let found = scale::agreement(&self.groups, |index| by_frame.get(&index).copied());
        let part = found.map_or(0.0, |agreement| agreement.part);
        if let Some(inverse) = self.inverse(&by_frame, part) {
            return Some(inverse);
        }
        let found = found.filter(|agreement| agreement.part >= AGREE);
        let scale = self.looks.first()?.1.scale;
        let remedy = |factor: f64| {
            format!(
                "`depth_unit_scale_factor` {} in the .json file would say so (now it is {})",
                length(factor * scale),
                length(scale)
            )
        };
        if let Some(Agreement { factor, part, as_is }) = found {
            let is_off = factor.ln().abs() > OFF.ln() && as_is < AS_WELL * part;
            return is_off.then(|| {
                Diagnostic::warning(format!(
                    "depth is probably in other units than the poses: times {}, {} of what views see in common has \
                     one place and colour, and {} as it is; if so, {}",
                    length(factor),
                    percent(part),
                    percent(as_is),
                    remedy(factor)
                ))
            });
        }
        let focus = dataset.focus()?;
        let distance = |sample: &Sample| sample.camera.position().distance(focus);
        let factors = samples().filter_map(|(_, sample)| Some(distance(sample) / sample.middle()?));
        let factor = Some(Spread::of(factors).median).filter(|factor| *factor > 0.0)?;
        (factor.ln().abs() > OFF_FOCUS.ln()).then(|| {
            Diagnostic::warning(format!(
                "depth may be in other units than the poses: times about {}, the middle of the pictures would be where \
                 the optical axes meet; if so, {}",
                length(factor),
                remedy(factor)
            ))
        })
    }
}
