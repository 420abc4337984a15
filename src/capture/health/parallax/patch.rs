//! Patches of a photo, and where along their rays they are.

use super::small_photo::SmallPhoto;
use crate::camera::{Bounds, Camera};
use crate::capture::dataset::evenly_spaced;
use glam::{DVec2, DVec3};

/// A patch reaches so many pixels to each side.
const REACH: i32 = 3;
const SIDE: usize = 2 * REACH as usize + 1;
/// Patches of a photo that are looked for.
const PATCHES: usize = 120;
/// Pixels between patches.
const APART: usize = 3;
/// Pixels by which a step in depth moves a patch in the other photo that is farthest away.
const STEP: f64 = 0.35;
/// Steps in depth at least and at most,
const STEPS: [f64; 2] = [30.0, 400.0];
/// from far away to this part of the way to where the box ends.
const NEAR: f64 = 0.15;
/// Deviation of the values of a patch that has something to be recognised by.
const TEXTURE: f64 = 0.03;
/// Correlation of patches that show the same,
const SAME: f64 = 0.85;
/// and how much less it is elsewhere.
const CLEARLY: f64 = 0.05;
/// Steps around the best one that are no elsewhere.
const PEAK: usize = 5;
/// Patches without anything to be recognised by are taken for others.
const FLAT: f64 = -0.5;
/// Patches that fewer others show are not recognised.
pub(super) const ENOUGH_VIEWS: usize = 2;
/// Where the end of the box is fewer steps from infinity, parallax does not tell what is beyond it;
const FAR: f64 = 3.5;
/// by so many steps, what is beyond it is clearly so.
const OFF: f64 = 2.5;
/// A patch that is seen larger by this factor is not the same any more.
const LARGER: f64 = 3.0;

type Values = [[f64; SIDE]; SIDE];

/// A patch of a photo.
pub(super) struct Patch {
    /// Through its middle, then to the left, right, top and bottom of it.
    lines: [Line; 5],
    /// Its values less their mean, of length 1.
    values: Values,
}

/// Points of world space for depths of a camera.
#[derive(Clone, Copy)]
struct Line {
    from: DVec3,
    direction: DVec3,
}

/// Whether a patch is in the box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    Unknown,
    Within,
    /// A box holds it that reaches about so far to each side, in world units.
    Beyond(f64),
}

/// Others that a camera's patches are looked for in.
pub(super) struct Sweep<'a> {
    others: &'a [&'a SmallPhoto],
    bounds: &'a Bounds,
    /// Difference of the inverse depths of two steps.
    step: f64,
}

impl Line {
    fn through(camera: &Camera, pixel: DVec2) -> Option<Self> {
        let [near, far] = [1.0, 2.0].map(|depth| camera.point(pixel, depth));
        let direction = far? - near?;
        Some(Self { from: near? - direction, direction })
    }

    fn at(&self, depth: f64) -> DVec3 {
        self.from + depth * self.direction
    }

    /// Depth at which it leaves the whole box; 0 where it is never in it.
    fn exit(&self, bounds: &Bounds) -> f64 {
        let to = |half: f64| (bounds.center + half * self.direction.signum() - self.from) / self.direction;
        let [near, far] = [-bounds.outer_half(), bounds.outer_half()].map(to);
        // Along a side it is neither entered nor left, which is no number or far away.
        let enters = near.to_array().into_iter().filter(|depth| depth.is_finite()).fold(0.0, f64::max);
        let leaves =
            far.to_array().into_iter().filter(|depth| depth.is_finite()).fold(f64::INFINITY, f64::min);
        if leaves > enters { leaves } else { 0.0 }
    }
}

/// Values less their mean, scaled to length 1; `None` where they are about the same.
fn normalized(mut values: Values) -> Option<Values> {
    let count = (SIDE * SIDE) as f64;
    let mean = values.as_flattened().iter().sum::<f64>() / count;
    let all = values.as_flattened_mut();
    all.iter_mut().for_each(|value| *value -= mean);
    let length = all.iter().map(|value| value * value).sum::<f64>().sqrt();
    all.iter_mut().for_each(|value| *value /= length);
    (length > TEXTURE * count.sqrt()).then_some(values)
}

/// What a photo shows around a place; `across` and `down` are from pixel to pixel.
fn seen(photo: &SmallPhoto, place: DVec2, [across, down]: [DVec2; 2]) -> Values {
    let offset = |at: usize| (at as i32 - REACH) as f64;
    std::array::from_fn(|y| std::array::from_fn(|x| photo.at(place + offset(x) * across + offset(y) * down)))
}

impl Patch {
    /// Some patches of a photo, those with something to be recognised by.
    pub(super) fn all_of(photo: &SmallPhoto) -> Vec<Self> {
        let [width, height] = [photo.camera.width, photo.camera.height].map(|side| side as usize);
        let inner = |side: usize| (REACH as usize..side.saturating_sub(REACH as usize)).step_by(APART);
        let places =
            inner(height).flat_map(|y| inner(width).map(move |x| DVec2::new(x as f64, y as f64) + 0.5));
        let known =
            places.filter_map(|place| Some((place, normalized(seen(photo, place, [DVec2::X, DVec2::Y]))?)));
        let patch = |(place, values): (DVec2, Values)| {
            let reach = f64::from(REACH);
            let offsets =
                [DVec2::ZERO, -reach * DVec2::X, reach * DVec2::X, -reach * DVec2::Y, reach * DVec2::Y];
            let lines = offsets.map(|offset| Line::through(&photo.camera, place + offset));
            let [Some(a), Some(b), Some(c), Some(d), Some(e)] = lines else { return None };
            Some(Self { lines: [a, b, c, d, e], values })
        };
        evenly_spaced(&known.collect::<Vec<_>>(), PATCHES).into_iter().filter_map(patch).collect()
    }

    /// Correlation with what another photo shows at a depth; `None` where that does not show all of it.
    fn correlation(&self, other: &SmallPhoto, depth: f64) -> Option<f64> {
        let place = |line: usize| Some(other.camera.project(self.lines[line].at(depth))?.0);
        let [middle, left, right, top, bottom] = [place(0)?, place(1)?, place(2)?, place(3)?, place(4)?];
        let size = f64::from(2 * REACH);
        let steps = [right - left, bottom - top].map(|whole| whole / size);
        // It may also lie on both sides of the rim of a panorama.
        if steps.iter().any(|step| step.length() > LARGER) {
            return None;
        }
        let values = seen(other, middle, steps);
        if values.as_flattened().iter().any(|value| value.is_nan()) {
            return None;
        }
        let product = |values: Values| -> f64 {
            values.as_flattened().iter().zip(self.values.as_flattened()).map(|(a, b)| a * b).sum()
        };
        Some(normalized(values).map_or(FLAT, product))
    }
}

impl<'a> Sweep<'a> {
    /// `None` where the others are where the camera is.
    pub(super) fn new(camera: &Camera, others: &'a [&'a SmallPhoto], bounds: &'a Bounds) -> Option<Self> {
        let distances = others.iter().map(|other| other.camera.position().distance(camera.position()));
        let step = STEP / (camera.pixels_per_length(1.0) * distances.fold(0.0, f64::max));
        step.is_finite().then_some(Self { others, bounds, step })
    }

    /// Mean correlation of a patch with what others show so many steps from infinity; -1 where too few show all of it.
    fn score(&self, patch: &Patch, at: usize) -> f64 {
        // Infinity itself is no place.
        let depth = 1.0 / ((at as f64).max(1e-3) * self.step);
        let all = self.others.iter().filter_map(|other| patch.correlation(other, depth));
        let (count, sum) = all.fold((0, 0.0), |(count, sum), score| (count + 1, sum + score));
        if count < ENOUGH_VIEWS { -1.0 } else { sum / count as f64 }
    }

    /// Whether a patch fits best in the box or beyond it.
    pub(super) fn judge(&self, patch: &Patch) -> Verdict {
        let leaves = 1.0 / (patch.lines[0].exit(self.bounds) * self.step);
        // Too far away to tell, or so near that the box ends before depth is tried.
        if leaves <= FAR || (leaves > STEPS[1] && leaves.is_finite()) {
            return Verdict::Unknown;
        }
        let steps = (leaves / NEAR).clamp(STEPS[0], STEPS[1]) as usize;
        let scores: Vec<f64> = (0..steps).map(|at| self.score(patch, at)).collect();
        let best = (0..steps).max_by(|&a, &b| scores[a].total_cmp(&scores[b])).unwrap_or(0);
        let most = |is_meant: &dyn Fn(usize) -> bool| {
            (0..steps).filter(|&at| is_meant(at)).map(|at| scores[at]).fold(-1.0, f64::max)
        };
        let is_clear = scores[best] > SAME && scores[best] - most(&|at| at.abs_diff(best) > PEAK) > CLEARLY;
        let within = most(&|at| at as f64 >= leaves - 1.0);
        let is_beyond = (best as f64) < leaves - OFF && scores[best] - within > CLEARLY;
        match is_clear {
            false => Verdict::Unknown,
            true if is_beyond => Verdict::Beyond(self.reach(patch, best)),
            true => Verdict::Within,
        }
    }

    /// How far out a patch is that is so many steps from infinity, as a box that just holds it would reach.
    fn reach(&self, patch: &Patch, at: usize) -> f64 {
        // Farther away than half a step from infinity, parallax tells nothing.
        let place = patch.lines[0].at(1.0 / ((at as f64).max(0.5) * self.step));
        (place - self.bounds.center).abs().max_element()
    }
}
