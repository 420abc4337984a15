//! Whether depth is in the units of the poses: what one view sees at its depth is where other views see the same colour.

use super::Sample;
use crate::camera::Camera;
use crate::capture::dataset::{Dataset, evenly_spaced};
use glam::DVec2;

/// Views whose points are looked at,
const ANCHORS: usize = 6;
/// from so many others: those whose distance is the smallest, the second, fourth, … smallest.
const PARTNERS: usize = 4;
/// Cosine between views that may see the same.
const OVERLAPPING: f64 = 0.25;
/// Points of a view that are looked at.
const POINTS: usize = 100;
/// Factors that are tried: powers of e from this one down to its inverse, in such steps.
const WIDEST: f64 = 9.2;
const STEP: f64 = 0.02;
/// Relative differences of depths that agree, and mean differences of their colours.
const CLOSE: f64 = 0.08;
const SAME: f32 = 0.1;
/// A factor for which others see less than this part of what they see for the best one tells little.
const SEEN: f64 = 0.6;
/// As good as the best agreement.
const NEARLY: f64 = 0.97;

/// A view and others that may see the same; indices.
pub(super) type Group = (usize, Vec<usize>);

/// How well the depth of views agrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Agreement {
    /// What depth is to be multiplied with.
    pub(super) factor: f64,
    /// The part of the points that agree then,
    pub(super) part: f64,
    /// and as they are.
    pub(super) as_is: f64,
}

/// Frames that are worth comparing, of those in `frames`.
pub(super) fn groups(dataset: &Dataset, frames: &[usize]) -> Vec<Group> {
    let camera = |index: usize| -> &Camera { &dataset.frames[index].camera };
    let group = |anchor: usize| {
        let distance = |index: usize| camera(index).position().distance(camera(anchor).position());
        let mut others = frames.to_vec();
        others.retain(|&other| {
            let cosine = camera(other).forward().dot(camera(anchor).forward());
            distance(other) > 0.0 && cosine > OVERLAPPING
        });
        others.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        let partners = (0..PARTNERS).filter_map(|doubled| others.get((1 << doubled) - 1).copied());
        (anchor, partners.collect())
    };
    evenly_spaced(frames, ANCHORS).into_iter().map(group).collect()
}

/// The factor for which most points agree; `None` where the views see nothing in common. `sample` is that of a frame.
pub(super) fn agreement<'a>(
    groups: &[Group],
    sample: impl Fn(usize) -> Option<&'a Sample>,
) -> Option<Agreement> {
    let mut all = Vec::new();
    for (anchor, partners) in groups {
        let Some(anchor) = sample(*anchor) else { continue };
        let points = evenly_spaced(&anchor.known().collect::<Vec<_>>(), POINTS);
        all.push((anchor, points, partners.iter().filter_map(|&other| sample(other)).collect::<Vec<_>>()));
    }
    let count = (WIDEST / STEP).round() as i32;
    let powers = (-count..=count).map(|number| STEP * f64::from(number));
    let tried: Vec<(f64, [usize; 2])> = powers.map(|power| (power, compare(&all, power.exp()))).collect();
    let most_seen = tried.iter().map(|(_, [seen, _])| *seen).max()?;
    let part = |[seen, agree]: [usize; 2]| agree as f64 / (seen as f64).max(SEEN * most_seen as f64).max(1.0);
    let best = |near: f64, within: f64| -> f64 {
        let near = tried.iter().filter(|(power, _)| (power - near).abs() <= within);
        near.map(|(_, counts)| part(*counts)).fold(0.0, f64::max)
    };
    let most = best(0.0, f64::INFINITY);
    // Where views are close together, all large factors are as good; the first hill counts.
    let first = tried.iter().map(|(power, _)| *power).find(|power| best(*power, 0.0) >= NEARLY * most)?;
    // Between the steps: the middle of the hill.
    let [mut sum, mut weights] = [0.0; 2];
    for (power, counts) in tried.iter().filter(|(power, _)| (power - first).abs() <= CLOSE) {
        let weight = part(*counts).powi(2);
        sum += weight * power;
        weights += weight;
    }
    let power = sum / weights.max(f64::MIN_POSITIVE);
    let as_is = best(0.0, 0.5 * CLOSE);
    (most > 0.0 && power.abs() < WIDEST - CLOSE).then_some(Agreement {
        factor: power.exp(),
        part: most,
        as_is,
    })
}

/// A view, points of it with their depth and colour, and others.
type Points<'a> = (&'a Sample, Vec<(DVec2, f64, [f32; 3])>, Vec<&'a Sample>);

/// How many of the points others see, and of those, how many are as far from there as its own depth says and have the same
/// colour, with depth times `factor`.
fn compare(all: &[Points<'_>], factor: f64) -> [usize; 2] {
    let [mut seen, mut agree] = [0; 2];
    for (anchor, points, others) in all {
        for &(pixel, depth, color) in points {
            let Some(point) = anchor.camera.point(pixel, factor * depth) else { continue };
            for other in others {
                let Some((place, distance)) = other.camera.project(point) else { continue };
                let Some((there, color_there)) = other.at(place) else { continue };
                let difference: f32 = color.iter().zip(color_there).map(|(a, b)| (a - b).abs()).sum();
                let is_there = (distance / (factor * there)).ln().abs() < CLOSE;
                seen += 1;
                agree += usize::from(is_there && difference < 3.0 * SAME);
            }
        }
    }
    [seen, agree]
}
