//! Poses that are all read the wrong way: other axes, or the inverse matrix.

use super::view_directions::ViewDirections;
use super::{CameraSet, Diagnostic};
use crate::camera::Camera;
use crate::capture::focus::{FocusKind, OpticalAxis, find};
use crate::support::format::{percent, point};
use glam::{DAffine3, DMat3, DVec3};

/// Fewer cameras meet somewhere by chance.
const LEAST_VIEWS: usize = 4;
/// Cameras that look at the focus when poses are read as they should.
const ENOUGH_SEE: f64 = 0.9;
/// Median distance of their axes from it, relative to the camera's distance.
const NEAR: f64 = 0.3;
/// Where fewer cameras than this look at a common point, another reading may be better.
const DOUBTFUL: f64 = 0.5;

/// Another way to read a pose.
struct AxisConvention {
    name: &'static str,
    remedy: &'static str,
    turn: fn(DAffine3) -> DAffine3,
    /// Whether photos taken outwards from one spot look like that, too.
    is_turned_round: bool,
}

const CONVENTIONS: [AxisConvention; 3] = [
    AxisConvention {
        name: "in OpenCV's axes (right, down, forward)",
        remedy: "change the sign of the second and third column of every `transform_matrix`",
        turn: from_open_cv,
        is_turned_round: true,
    },
    AxisConvention {
        name: "world-to-camera",
        remedy: "write the inverse of every `transform_matrix`",
        turn: |pose| pose.inverse(),
        is_turned_round: false,
    },
    AxisConvention {
        name: "world-to-camera in OpenCV's axes (right, down, forward)",
        remedy: "write the inverse of every `transform_matrix` with the sign of its second and third column changed",
        turn: |pose| from_open_cv(pose.inverse()),
        is_turned_round: false,
    },
];

fn from_open_cv(pose: DAffine3) -> DAffine3 {
    let matrix3 = pose.matrix3 * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    DAffine3 { matrix3, ..pose }
}

/// How well cameras agree on what they look at.
struct Agreement {
    focus: DVec3,
    seeing: f64,
    miss: f64,
}

/// Whether another reading of all poses makes the cameras look at one point, which they do not as they are.
pub(super) fn examine(scene: &CameraSet<'_>, directions: &ViewDirections) -> Vec<Diagnostic> {
    let looks = directions.meets || directions.seeing >= DOUBTFUL;
    if looks || scene.count() < LEAST_VIEWS {
        return Vec::new();
    }
    let conventions =
        CONVENTIONS.iter().filter_map(|convention| Some((convention, agreement(scene, convention.turn)?)));
    let best = conventions.min_by(|(_, a), (_, b)| a.miss.total_cmp(&b.miss));
    let Some((convention, agreement)) = best else { return Vec::new() };
    let few = if directions.seeing > 0.0 {
        format!("only {}", percent(directions.seeing))
    } else {
        "none".to_owned()
    };
    let seen = format!(
        "as they are, {few} of the cameras see a common point; read that way, {} see {} and their axes pass it at {} of \
         the distance",
        percent(agreement.seeing),
        point(agreement.focus, scene.extent()),
        percent(agreement.miss)
    );
    vec![if convention.is_turned_round && directions.up.z > 0.5 {
        // Turned round, these cameras would be upside down in a world whose z points up.
        Diagnostic::note(format!(
            "the cameras look outwards, which is right for photos taken around oneself; they may be {}: {seen}. If the \
             subject was in the middle, {}",
            convention.name, convention.remedy
        ))
    } else {
        Diagnostic::warning(format!(
            "the poses are probably {}: {seen}; {}{}",
            convention.name,
            convention.remedy,
            if convention.is_turned_round {
                ", unless the photos were taken outwards from one spot"
            } else {
                ""
            }
        ))
    }]
}

/// How well the cameras agree when their poses are read that way; `None` where they do not.
fn agreement(scene: &CameraSet<'_>, turn: fn(DAffine3) -> DAffine3) -> Option<Agreement> {
    let axis = |camera: &Camera| {
        OpticalAxis::of(&Camera { world_from_camera: turn(camera.world_from_camera), ..camera.clone() })
    };
    let axes: Vec<OpticalAxis> = scene.cameras().map(axis).collect();
    let focus = find(&axes);
    let seeing = axes.iter().filter(|axis| axis.sees(focus.point)).count() as f64 / axes.len() as f64;
    let miss = |axis: &OpticalAxis| {
        let (along, across) = axis.along_and_across(focus.point);
        across / along.abs().max(f64::MIN_POSITIVE)
    };
    let miss = super::Spread::of(axes.iter().map(miss)).median;
    let agrees = focus.kind == FocusKind::Crossing && seeing >= ENOUGH_SEE && miss < NEAR;
    agrees.then_some(Agreement { focus: focus.point, seeing, miss })
}
