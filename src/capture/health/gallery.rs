//! What single photos look like, and which stand out: blurred, dark, blown out, or shown twice.

mod grey;
mod masks;

use super::{Diagnostic, Spread, names};
use crate::capture::dataset::Dataset;
use crate::photo::Photo;
use crate::support::format::count;
use grey::{Grey, THUMBNAIL};
use masks::Ignored;
use std::collections::HashMap;

/// Longest side that sharpness is measured at, in pixels: finer detail is noise as often as detail.
const MOST_SIDE: u32 = 1024;
/// Edges are found at this part of the size.
const COARSE: u32 = 4;
/// Fewer pixels at that size are too few to measure.
const ENOUGH_PIXELS: usize = 150;
/// Frames before and after that a photo is compared with.
const NEIGHBOURS: usize = 3;
/// A blurred photo has less than this part of the sharpness of its neighbours,
const BLURRED: f64 = 0.2;
/// and of all photos.
const BLURRED_OF_ALL: f64 = 0.3;
/// Variance of a picture that shows nothing, in display-referred values.
const FLAT: f64 = 1e-6;
/// Stops that the mean brightness of a photo may differ from the middle of all,
const MOST_STOPS: f64 = 2.0;
/// and how many deviations.
const DEVIATIONS: f64 = 6.0;
/// Values up to here are black, and from here on white.
const BLACK: f32 = 0.02;
const WHITE: f32 = 0.98;
/// Root mean square difference of thumbnails that show different things.
const DIFFERENT: f64 = 0.03;
/// Part of a photo that is.
const NEARLY_ALL: f64 = 0.99;

/// What matters about one photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Strength of fine detail relative to the edges it belongs to, at a reduced size; `None` for a picture without
    /// edges.
    pub sharpness: Option<f64>,
    /// Mean linear brightness of what is not transparent, 1 for white, or the typical one of a linear photo; `None`
    /// where all is transparent.
    pub brightness: Option<f64>,
    /// Part of what is not transparent that is black.
    pub black: f64,
    /// Part that is white; HDR photos have no white.
    pub white: f64,
    /// Whether every pixel is transparent or masked out.
    pub is_empty: bool,
    /// Whether masks ignore every pixel: there is nothing to train on.
    pub is_ignored: bool,
    /// What masks ignore of it.
    ignored: Ignored,
    /// Whether it has one brightness everywhere.
    is_flat: bool,
    /// Tells pictures of different content apart.
    fingerprint: u64,
    /// Brightness in coarse blocks, to compare photos of one pose.
    thumbnail: [f32; THUMBNAIL * THUMBNAIL],
}

impl Look {
    /// Looks at a photo.
    #[must_use]
    pub fn of(photo: &Photo) -> Self {
        let image = &photo.image;
        let fine = Grey::of(photo, image.width.max(image.height).div_ceil(MOST_SIDE));
        let coarse = fine.reduced(COARSE);
        let edges = coarse.gradient_energy() * f64::from(COARSE * COARSE);
        let has_edges = coarse.pixels() >= ENOUGH_PIXELS && coarse.variance() > FLAT && edges > 0.0;
        let [brightness, black, white] =
            coarse.opaque_means([|v| v.powf(2.2), |v| f32::from(v < BLACK), |v| f32::from(v > WHITE)]);
        let is_empty = brightness.is_none() || photo.is_ignored();
        // Linear photos are toned by their own brightness.
        let brightness = if image.is_hdr() { brightness.and_then(|_| image.grey()) } else { brightness };
        Self {
            sharpness: has_edges.then(|| fine.laplacian_energy() / edges),
            brightness,
            black: black.unwrap_or(0.0),
            white: white.filter(|_| !image.is_hdr()).unwrap_or(0.0),
            is_empty,
            is_ignored: photo.is_ignored(),
            ignored: Ignored::of(photo),
            is_flat: coarse.variance() <= FLAT,
            fingerprint: fine.fingerprint(),
            thumbnail: coarse.thumbnail(),
        }
    }

    /// Whether there is something, and all of it is black.
    fn is_black(&self) -> bool {
        !self.is_empty && (self.black >= NEARLY_ALL || self.brightness == Some(0.0))
    }
}

/// All photos that could be decoded, in the order of the frames.
#[derive(Clone, Debug, Default)]
pub struct Gallery {
    /// Indices of frames, and their looks.
    pub looks: Vec<(usize, Look)>,
}

impl Gallery {
    /// The sharpness of the photos.
    #[must_use]
    pub fn sharpness(&self) -> Spread {
        Spread::of(self.looks.iter().filter_map(|(_, look)| look.sharpness))
    }

    /// The mean linear brightness of the photos that are not black; how many stops black is below others says nothing.
    #[must_use]
    pub fn brightness(&self) -> Spread {
        let lit = self.looks.iter().filter(|(_, look)| !look.is_black());
        Spread::of(lit.filter_map(|(_, look)| look.brightness))
    }

    /// Number of photos that show nothing but black.
    #[must_use]
    pub fn black(&self) -> usize {
        self.looks.iter().filter(|(_, look)| look.is_black()).count()
    }

    /// What stands out.
    #[must_use]
    pub fn findings(&self, dataset: &Dataset) -> Vec<Diagnostic> {
        let mut findings: Vec<Diagnostic> =
            [self.blurred(dataset), self.uneven(dataset), self.repeated(dataset)]
                .into_iter()
                .flatten()
                .collect();
        findings.extend(self.blank(dataset));
        findings.extend(self.about_masks(dataset));
        findings.sort_by_key(|finding| finding.severity);
        findings
    }

    /// Photos that show nothing.
    fn blank(&self, dataset: &Dataset) -> impl Iterator<Item = Diagnostic> {
        type Kind = (fn(&Look) -> bool, &'static str, &'static str);
        let kinds: [Kind; 3] = [
            (
                |look| look.is_empty,
                "nothing: every pixel is transparent or masked out",
                "check the alpha channel, or the masks for being inverted",
            ),
            (Look::is_black, "nothing but black", "drop those that are not meant to be black"),
            (
                |look| look.white >= NEARLY_ALL,
                "nothing but white",
                "drop those that are not meant to be white",
            ),
        ];
        // Where that holds for all, it is an error, and not said twice.
        let is_said = self.leaves_nothing(dataset);
        kinds.into_iter().filter_map(move |(holds, what, remedy)| {
            let frames = self.which(|(_, look)| holds(look) && !(look.is_ignored && is_said));
            let number = count(frames.len(), "photo");
            let verb = if frames.len() == 1 { "shows" } else { "show" };
            let message = format!("{number} {verb} {what}: {}; {remedy}", names(dataset, &frames));
            (!frames.is_empty()).then(|| Diagnostic::warning(message).about(frames))
        })
    }

    /// Whether two frames, which have one pose, show different pictures.
    pub(super) fn differ(&self, pair: [usize; 2]) -> bool {
        let look = |index: usize| self.looks.iter().find(|(other, _)| *other == index).map(|(_, look)| look);
        let [Some(a), Some(b)] = pair.map(look) else { return true };
        let squares = a.thumbnail.iter().zip(b.thumbnail).map(|(a, b)| f64::from(a - b).powi(2));
        squares.sum::<f64>() / a.thumbnail.len() as f64 > DIFFERENT.powi(2)
    }

    fn which(&self, holds: impl Fn(&(usize, Look)) -> bool) -> Vec<usize> {
        self.looks.iter().filter(|look| holds(look)).map(|(index, _)| *index).collect()
    }

    /// Photos less sharp than those before and after. Views of synthetic scenes follow in any order, so all photos
    /// together must be sharper, too.
    fn blurred(&self, dataset: &Dataset) -> Option<Diagnostic> {
        let of_all = self.sharpness().median;
        let parts: Vec<(usize, f64)> = self
            .looks
            .iter()
            .enumerate()
            .filter_map(|(place, (frame, look))| {
                let sharpness = look.sharpness?;
                let around = self.looks[place.saturating_sub(NEIGHBOURS)..].iter().take(2 * NEIGHBOURS + 1);
                let size = |index: usize| dataset.frames[index].camera.width;
                let neighbours = around.filter(|(other, _)| other != frame && size(*other) == size(*frame));
                let around = Spread::of(neighbours.filter_map(|(_, look)| look.sharpness)).median;
                let is_blurred = sharpness < BLURRED * around && sharpness < BLURRED_OF_ALL * of_all;
                is_blurred.then_some((*frame, sharpness / around))
            })
            .collect();
        let worst = parts.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
        let frames: Vec<usize> = parts.iter().map(|(frame, _)| *frame).collect();
        Some(
            Diagnostic::warning(format!(
                "{} {} far less fine detail than the frames around, at worst {:.0} % of it ({}): {}; drop or retake \
                 what is blurred, a few blurred photos blur the whole field; what shows a plain surface is right",
                count(frames.len(), "photo"),
                if frames.len() == 1 { "has" } else { "have" },
                100.0 * worst.1,
                dataset.frames[worst.0].name,
                names(dataset, &frames)
            ))
            .about(frames),
        )
    }

    /// Photos much brighter or darker than the others.
    fn uneven(&self, dataset: &Dataset) -> Option<Diagnostic> {
        let stops = |look: &Look| look.brightness.filter(|_| !look.is_black()).map(f64::log2);
        let all: Vec<f64> = self.looks.iter().filter_map(|(_, look)| stops(look)).collect();
        let middle = Spread::of(all.iter().copied()).median;
        let deviation = 1.4826 * Spread::of(all.iter().map(|stop| (stop - middle).abs())).median;
        let limit = MOST_STOPS.max(DEVIATIONS * deviation);
        let off = |look: &Look| stops(look).map_or(0.0, |stop| stop - middle);
        let frames = self.which(|(_, look)| off(look).abs() > limit);
        let worst = self.looks.iter().max_by(|a, b| off(&a.1).abs().total_cmp(&off(&b.1).abs()))?;
        (!frames.is_empty()).then(|| {
            let way = if off(&worst.1) > 0.0 { "brighter" } else { "darker" };
            Diagnostic::warning(format!(
                "the exposure of {} differs from the others, at worst {} is {:.1} stops {way} than usual: {}; develop the \
                 photos with one exposure and white balance, or drop these",
                count(frames.len(), "photo"),
                dataset.frames[worst.0].name,
                off(&worst.1).abs(),
                names(dataset, &frames)
            ))
            .about(frames)
        })
    }

    /// The same picture under two names.
    fn repeated(&self, dataset: &Dataset) -> Option<Diagnostic> {
        let mut first: HashMap<u64, usize> = HashMap::new();
        let mut pairs = Vec::new();
        for (index, look) in self.looks.iter().filter(|(_, look)| !look.is_flat) {
            match first.get(&look.fingerprint) {
                Some(&other) => pairs.push([other, *index]),
                None => _ = first.insert(look.fingerprint, *index),
            }
        }
        let &[a, b] = pairs.first()?;
        let frames: Vec<usize> = pairs.iter().map(|pair| pair[1]).collect();
        let pose = |index: usize| dataset.frames[index].camera.world_from_camera;
        let where_to = if pose(a).abs_diff_eq(pose(b), 1e-9) { "the same pose" } else { "different poses" };
        Some(
            Diagnostic::warning(format!(
                "{} the same picture as another frame: {} is {}, with {where_to}{}; drop one of each",
                if frames.len() == 1 {
                    "1 frame shows".to_owned()
                } else {
                    format!("{} frames show", frames.len())
                },
                dataset.frames[b].name,
                dataset.frames[a].name,
                if frames.len() > 1 { ", for example" } else { "" }
            ))
            .about(frames),
        )
    }
}
