//! Single poses that look wrong: far from the others, turned away, or given twice.

use super::view_directions::ViewDirections;
use super::{CameraSet, Diagnostic, Spread};
use crate::camera::Geometry;
use crate::capture::dataset::Dataset;
use crate::support::format::{count, length};
use glam::DVec3;

/// Fewer views have no rule that one could be an exception from.
const LEAST_VIEWS: usize = 5;
/// A camera counts as stray beyond so many typical distances from the middle of all,
const FAR: f64 = 4.0;
/// and so many deviations (1.4826 median absolute deviations, as for a normal distribution).
const DEVIATIONS: f64 = 8.0;
const PER_DEVIATION: f64 = 1.4826;
/// In a sequence, a camera counts as stray beyond so many typical steps from both of its neighbours,
const JUMP: f64 = 8.0;
/// which are no farther apart than so many.
const STRIDE: f64 = 3.0;
/// Strays are few: what many cameras do is on purpose.
const FEW: f64 = 0.05;
/// Where so many cameras look at the focus, the others are exceptions.
const NEARLY_ALL: f64 = 0.9;
/// And they look away from it by so many of their half fields of view.
const TURNED_AWAY: f64 = 2.0;
/// Poses that differ by less, relative to the extent of all cameras, are one.
const SAME: f64 = 1e-6;

/// Cameras that are far from all others, or look elsewhere.
pub(super) fn outliers(scene: &CameraSet<'_>, directions: &ViewDirections) -> Vec<Diagnostic> {
    if scene.count() < LEAST_VIEWS {
        return Vec::new();
    }
    let positions: Vec<DVec3> = scene.axes.iter().map(|axis| axis.origin).collect();
    let mut findings = Vec::new();
    let far = far_away(&positions);
    if is_few(&far, scene) {
        let middle = middle(&positions);
        let typical = Spread::of(positions.iter().map(|p| p.distance(middle))).median;
        let first = far[0];
        let frames = frames(scene, &far);
        let names = scene.names(&frames);
        let message = format!(
            "{} far from all others: {} from their middle, where {} is usual, in {names}; check or drop the pose",
            are(&far),
            length(positions[first].distance(middle)),
            length(typical),
        );
        findings.push(Diagnostic::warning(message).about(frames));
    }
    let jumps: Vec<usize> = jumps(&positions)
        .into_iter()
        .filter(|view| !far.contains(view) && is_within_folder(scene, *view))
        .collect();
    if is_few(&jumps, scene) {
        let step = |view: usize| positions[view].distance(positions[view - 1]);
        let frames = frames(scene, &jumps);
        let names = scene.names(&frames);
        let message = format!(
            "{} {} away from the frames before and after, which are close together, where {} is a usual step: {names}; \
             check or drop the pose",
            are(&jumps),
            length(step(jumps[0])),
            length(Spread::of((1..positions.len()).map(step)).median),
        );
        findings.push(Diagnostic::warning(message).about(frames));
    }
    let away: Vec<usize> = away(scene, directions).into_iter().filter(|view| !far.contains(view)).collect();
    if is_few(&away, scene) {
        let frames = frames(scene, &away);
        let names = scene.names(&frames);
        let message = format!(
            "{} turned away from what {:.0} % of the cameras look at, by {:.0}° in {names}; check or drop the pose",
            are(&away),
            100.0 * directions.seeing,
            directions.off_rad[away[0]].to_degrees(),
        );
        findings.push(Diagnostic::warning(message).about(frames));
    }
    findings
}

fn are(views: &[usize]) -> String {
    format!("{} {}", count(views.len(), "camera"), if views.len() == 1 { "is" } else { "are" })
}

fn frames(scene: &CameraSet<'_>, views: &[usize]) -> Vec<usize> {
    views.iter().map(|&view| scene.views[view]).collect()
}

fn is_few(views: &[usize], scene: &CameraSet<'_>) -> bool {
    !views.is_empty() && views.len() as f64 <= f64::max(1.0, FEW * scene.count() as f64)
}

/// Whether the frames before and after are of the same folder, and so perhaps of one sequence.
fn is_within_folder(scene: &CameraSet<'_>, view: usize) -> bool {
    let folder =
        |view: usize| scene.dataset.frames[scene.views[view]].name.rsplit_once('/').map(|parts| parts.0);
    folder(view - 1) == folder(view) && folder(view) == folder(view + 1)
}

/// The point whose coordinates are the middle ones.
fn middle(positions: &[DVec3]) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|axis| Spread::of(positions.iter().map(|p| p[axis])).median))
}

fn far_away(positions: &[DVec3]) -> Vec<usize> {
    let middle = middle(positions);
    let distances: Vec<f64> = positions.iter().map(|p| p.distance(middle)).collect();
    let typical = Spread::of(distances.iter().copied()).median;
    let deviation = PER_DEVIATION * Spread::of(distances.iter().map(|d| (d - typical).abs())).median;
    let limit = f64::max(FAR * typical, typical + DEVIATIONS * deviation);
    (0..positions.len()).filter(|&view| distances[view] > limit && limit > 0.0).collect()
}

/// Places in a sequence that lead away and back.
fn jumps(positions: &[DVec3]) -> Vec<usize> {
    let step = |view: usize| positions[view].distance(positions[view - 1]);
    let typical = Spread::of((1..positions.len()).map(step)).median;
    let is_jump = |&view: &usize| {
        let apart = positions[view + 1].distance(positions[view - 1]);
        step(view).min(step(view + 1)) > JUMP * typical && apart < STRIDE * typical
    };
    (1..positions.len() - 1).filter(is_jump).collect()
}

fn away(scene: &CameraSet<'_>, directions: &ViewDirections) -> Vec<usize> {
    if !directions.meets || directions.seeing < NEARLY_ALL {
        return Vec::new();
    }
    let cameras: Vec<_> = scene.cameras().collect();
    let is_away = |&view: &usize| {
        let axis = &scene.axes[view];
        let distance = axis.origin.distance(directions.focus).max(f64::MIN_POSITIVE);
        let half_view = (axis.half_width_at(distance) / distance).atan();
        // Lenses that see all around may point anywhere.
        let points = cameras[view].lens.geometry() != Geometry::Angles;
        points && directions.off_rad[view] > TURNED_AWAY * half_view
    };
    (0..scene.count()).filter(is_away).collect()
}

/// Pairs of frames with different images and the same pose; of several with one pose, each with the first.
pub(super) fn repeated(scene: &CameraSet<'_>) -> Vec<[usize; 2]> {
    let extent = scene.extent();
    let cameras: Vec<_> = scene.cameras().collect();
    // All cameras at one place is another matter.
    if scene.is_one_place() {
        return Vec::new();
    }
    let is_same = |a: usize, b: usize| {
        let (a, b) = (cameras[a].world_from_camera, cameras[b].world_from_camera);
        a.translation.distance(b.translation) <= SAME * extent && a.matrix3.abs_diff_eq(b.matrix3, SAME)
    };
    let x = |view: usize| cameras[view].position().x;
    let mut order: Vec<usize> = (0..cameras.len()).collect();
    order.sort_by(|&a, &b| x(a).total_cmp(&x(b)));
    let mut pairs: Vec<[usize; 2]> = Vec::new();
    for (place, &view) in order.iter().enumerate() {
        let near = order[..place].iter().rev().take_while(|&&other| x(view) - x(other) <= SAME * extent);
        if let Some(&first) = near.filter(|&&other| is_same(view, other)).last() {
            pairs.push([view.min(first), view.max(first)]);
        }
    }
    pairs.sort_unstable();
    pairs.into_iter().map(|pair| pair.map(|view| scene.views[view])).collect()
}

/// What to say of frames with the same pose; whether their pictures differ may be unknown.
pub(super) fn about_repeated(
    dataset: &Dataset,
    pairs: &[[usize; 2]],
    differ: Option<bool>,
) -> Option<Diagnostic> {
    let &[first, second] = pairs.first()?;
    let mut frames = pairs.concat();
    frames.sort_unstable();
    frames.dedup();
    let name = |frame: usize| &dataset.frames[frame].name;
    let where_they_are = format!(
        "{} share their pose with another one: {} is where {} is{}",
        count(frames.len(), "frame"),
        name(second),
        name(first),
        if pairs.len() > 1 { ", for example" } else { "" },
    );
    Some(match differ {
        Some(true) => Diagnostic::warning(format!(
            "{where_they_are}, and their pictures differ; unless the scene moves or the light changes, correct or drop \
             the wrong pose"
        ))
        .about(frames),
        Some(false) => Diagnostic::note(format!("{where_they_are}; their pictures look the same")),
        None => Diagnostic::note(format!(
            "{where_they_are}; unless the camera stood still or the scene moves, one of the poses is wrong"
        )),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    /// A walk around a circle.
    fn walk() -> Vec<DVec3> {
        let at = |index: i32| (0.1 * f64::from(index)).sin_cos();
        (0..40).map(|index| dvec3(4.0 * at(index).0, 4.0 * at(index).1, 1.0)).collect()
    }

    #[test]
    fn strays_are_found_among_walkers() {
        let mut positions = walk();
        assert_eq!((far_away(&positions), jumps(&positions)), (vec![], vec![]));
        positions[7] = dvec3(40.0, 0.0, 1.0);
        assert_eq!(far_away(&positions), [7]);
        positions[7] = dvec3(0.0, -4.0, 1.0);
        assert_eq!((far_away(&positions), jumps(&positions)), (vec![], vec![7]));
    }

    #[test]
    fn a_line_and_a_random_order_have_no_strays() {
        let line: Vec<_> = (0..30).map(|index| dvec3(f64::from(index), 0.0, 0.0)).collect();
        assert_eq!((far_away(&line), jumps(&line)), (vec![], vec![]));
        let shuffled: Vec<_> = (0..40).map(|index| walk()[index * 17 % 40]).collect();
        assert_eq!((far_away(&shuffled), jumps(&shuffled)), (vec![], vec![]));
    }
}
