//! Poses that are all read the wrong way: other axes, or the inverse matrix.
//!
//! That another reading makes the cameras look at one point is not enough: turned round, photos that were taken outwards
//! from one spot do so too, and the inverse of a pan around one vertical is an orbit around another. What tells them
//! apart is how the cameras were held: as a rule upright or turned by a quarter ([`Hold`]). A reading that has them so
//! speaks for itself, and one that has them roll through all angles does not.

use super::roll::Hold;
use super::view_directions::ViewDirections;
use super::{CameraSet, Diagnostic};
use crate::camera::{Camera, LensKind};
use crate::capture::diagnostics::Severity;
use crate::capture::focus::{Focus, FocusKind, OpticalAxis, find};
use crate::support::format::{percent, point};
use glam::{DAffine3, DMat3, DVec3};

/// Fewer cameras meet somewhere by chance.
const LEAST_VIEWS: usize = 4;
/// Cameras that look at the focus when poses are read as they should.
const ENOUGH_SEE: f64 = 0.9;
/// Median distance of their axes from it, relative to the camera's distance.
const NEAR: f64 = 0.3;
/// And where they were aimed at it, and the camera went up and down.
const AIMED: f64 = 0.1;
/// Where fewer cameras than this look at a common point, another reading may be better.
const DOUBTFUL: f64 = 0.5;
/// Typical roll of cameras in people's hands, in degrees.
const HELD_DEGREES: f64 = 12.0;
/// Cameras that are rolled by less are held as well as any.
const BARELY_DEGREES: f64 = 4.0;
/// An orbit from above or below, or up and down, in degrees.
const RAISED_DEGREES: f64 = 10.0;
/// Positions as they are read that lie this near to the third axis, relative to their distance from the origin, are
/// what world-to-camera matrices have in their last column where the origin is the middle of the scene.
const AHEAD: f64 = 0.3;

/// Another way to read a pose.
#[derive(Debug)]
struct AxisConvention {
    name: &'static str,
    remedy: &'static str,
    turn: fn(DAffine3) -> DAffine3,
    is_inverse: bool,
}

const CONVENTIONS: [AxisConvention; 3] = [
    AxisConvention {
        name: "in OpenCV's axes (right, down, forward)",
        remedy: "change the sign of the second and third column of every `transform_matrix`",
        turn: from_open_cv,
        is_inverse: false,
    },
    AxisConvention {
        name: "world-to-camera",
        remedy: "write the inverse of every `transform_matrix`",
        turn: |pose| pose.inverse(),
        is_inverse: true,
    },
    AxisConvention {
        name: "world-to-camera in OpenCV's axes (right, down, forward)",
        remedy: "write the inverse of every `transform_matrix` with the sign of its second and third column changed",
        turn: |pose| from_open_cv(pose.inverse()),
        is_inverse: true,
    },
];

fn from_open_cv(pose: DAffine3) -> DAffine3 {
    let matrix3 = pose.matrix3 * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    DAffine3 { matrix3, ..pose }
}

/// How well cameras agree on what they look at.
#[derive(Debug)]
struct Agreement {
    focus: DVec3,
    seeing: f64,
    miss: f64,
    /// How they are held.
    hold: Option<Hold>,
    /// Whether they are aimed at the focus from above or below, or from up and down.
    is_aimed: bool,
}

/// A reading that may be the right one.
#[derive(Debug)]
struct Suspicion {
    convention: &'static AxisConvention,
    agreement: Agreement,
    severity: Severity,
}

/// Whether another reading of all poses makes the cameras look at one point, which they do not as they are.
pub(super) fn examine(scene: &CameraSet<'_>, directions: &ViewDirections) -> Option<Diagnostic> {
    if !is_doubtful(&scene.focus, directions.seeing) {
        return None;
    }
    let cameras: Vec<&Camera> = scene.cameras().collect();
    let Suspicion { convention, agreement, severity } = suspect(&cameras)?;
    let now = match directions.seeing {
        _ if scene.focus.kind == FocusKind::Ahead => "the optical axes do not meet".to_owned(),
        0.0 => "none of the cameras see a common point".to_owned(),
        seeing => format!("only {} of the cameras see a common point", percent(seeing)),
    };
    let message = format!(
        "the poses may be {}: as they are, {now}; read that way, {} see {} and their axes \
         pass it at {} of the distance. If the cameras looked at something in their middle, {}; if they looked outwards (a \
         room or surroundings from within, a panorama), the poses are right, and that would spoil them",
        convention.name,
        percent(agreement.seeing),
        // Poses read wrongly may all be in one place.
        point(agreement.focus, scene.extent().max(agreement.focus.length())),
        percent(agreement.miss),
        convention.remedy,
    );
    Some(Diagnostic::new(severity, message))
}

/// Whether the cameras do not show by what they see that they are read rightly. A point ahead is seen by all anyhow.
fn is_doubtful(focus: &Focus, seeing: f64) -> bool {
    match focus.kind {
        FocusKind::Crossing => false,
        FocusKind::Ahead => true,
        FocusKind::Origin | FocusKind::Inside => seeing < DOUBTFUL,
    }
}

/// The most likely of the other readings, if one is likely at all.
fn suspect(cameras: &[&Camera]) -> Option<Suspicion> {
    // The axis of a picture of everything around says nothing.
    let is_pointed = |camera: &&&Camera| camera.lens.kind() != LensKind::Equirectangular;
    if cameras.len() < LEAST_VIEWS || 2 * cameras.iter().filter(is_pointed).count() <= cameras.len() {
        return None;
    }
    let poses: Vec<DAffine3> = cameras.iter().map(|camera| camera.world_from_camera).collect();
    let axes: Vec<DMat3> = poses.iter().map(|pose| pose.matrix3).collect();
    let hold = Hold::of(&axes);
    let judge = |convention: &'static AxisConvention| {
        let agreement = agreement(cameras, convention.turn)?;
        let severity = match convention.is_inverse {
            true => inverted(&poses, hold, &agreement),
            false => turned_round(&axes, hold, &agreement),
        }?;
        Some(Suspicion { convention, agreement, severity })
    };
    let suspicions = CONVENTIONS.iter().filter_map(judge);
    suspicions.min_by(|a, b| a.severity.cmp(&b.severity).then(a.agreement.miss.total_cmp(&b.agreement.miss)))
}

fn is_held(hold: Option<Hold>) -> bool {
    hold.is_some_and(|hold| hold.roll_degrees < HELD_DEGREES)
}

/// Whether cameras that seem held are much more so when read otherwise.
fn is_better_held(hold: Option<Hold>, other: Option<Hold>) -> bool {
    hold.zip(other)
        .is_some_and(|(hold, other)| hold.roll_degrees > f64::max(BARELY_DEGREES, 3.0 * other.roll_degrees))
}

/// How likely it is that poses are inverted which agree on a focus that way.
fn inverted(poses: &[DAffine3], hold: Option<Hold>, other: &Agreement) -> Option<Severity> {
    match (is_held(hold), is_held(other.hold)) {
        (false, true) => Some(Severity::Warning),
        // The inverse of a pan is an orbit, and the other way round.
        (true, true) if origin_is_ahead(poses) || is_better_held(hold, other.hold) => Some(Severity::Warning),
        (true, true) | (false, false) => (other.miss < AIMED).then_some(Severity::Note),
        (true, false) => None,
    }
}

/// Whether the last columns are about the same and along the third axis.
fn origin_is_ahead(poses: &[DAffine3]) -> bool {
    let mean = poses.iter().map(|pose| pose.translation).sum::<DVec3>() / poses.len() as f64;
    let spread = poses.iter().map(|pose| pose.translation.distance(mean)).fold(0.0, f64::max);
    mean.truncate().length() + spread < AHEAD * mean.z.abs()
}

/// How likely it is that cameras look inwards which look outwards as they are read.
fn turned_round(axes: &[DMat3], hold: Option<Hold>, other: &Agreement) -> Option<Severity> {
    let Some(hold) = hold.filter(|_| is_held(hold)) else { return Some(Severity::Note) };
    let is_axis = |axis: DVec3| hold.vertical.dot(axis).abs() > 0.999;
    let up = hold.upright(axes);
    // Upright in a world whose z points up, they are what they seem; upside down in it, they are not.
    if is_axis(DVec3::Z) && up.abs() > 0.5 {
        return (up < 0.0).then_some(Severity::Warning);
    }
    let is_upside_down = up < -0.5 && is_axis(DVec3::Y);
    let is_aligned = DVec3::AXES.into_iter().any(is_axis);
    (is_upside_down || other.is_aimed || !is_aligned).then_some(Severity::Note)
}

/// How well the cameras agree when their poses are read that way; `None` where they do not.
fn agreement(cameras: &[&Camera], turn: fn(DAffine3) -> DAffine3) -> Option<Agreement> {
    let turned: Vec<DAffine3> = cameras.iter().map(|camera| turn(camera.world_from_camera)).collect();
    let axis = |(camera, pose): (&&Camera, &DAffine3)| {
        OpticalAxis::of(&Camera { world_from_camera: *pose, ..(*camera).clone() })
    };
    let axes: Vec<OpticalAxis> = cameras.iter().zip(&turned).map(axis).collect();
    let focus = find(&axes);
    let seeing = axes.iter().filter(|axis| axis.sees(focus.point)).count() as f64 / axes.len() as f64;
    let miss = |axis: &OpticalAxis| {
        let (along, across) = axis.along_and_across(focus.point);
        across / along.abs().max(f64::MIN_POSITIVE)
    };
    let miss = super::Spread::of(axes.iter().map(miss)).median;
    let hold = Hold::of(&turned.iter().map(|pose| pose.matrix3).collect::<Vec<_>>());
    let is_aimed = hold.is_some_and(|hold| {
        let raised = |axis: &OpticalAxis| {
            (axis.origin - focus.point).normalize_or_zero().dot(hold.vertical).asin().to_degrees()
        };
        let raised = super::Spread::of(axes.iter().map(raised));
        miss < AIMED && raised.min.abs().max(raised.max.abs()) > RAISED_DEGREES
    });
    let agrees = focus.kind == FocusKind::Crossing && seeing >= ENOUGH_SEE && miss < NEAR;
    agrees.then_some(Agreement { focus: focus.point, seeing, miss, hold, is_aimed })
}

#[cfg(test)]
mod tests;
