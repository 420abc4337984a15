//! Where the cameras look: the point their axes meet in, how nearly, and from how many sides.

use super::roll::STEEP;
use super::{CameraSet, Diagnostic, Spread};
use crate::camera::orbit::Orbit;
use crate::capture::focus::FocusKind;
use crate::support::format::{count, length, percent, point};
use glam::DVec3;
use serde::Serialize;
use std::f64::consts::TAU;

/// Where the cameras look.
#[derive(Clone, Debug)]
pub struct ViewDirections {
    /// The point the axes meet in, or what stands for it; world space.
    pub focus: DVec3,
    /// Whether the axes meet there.
    pub meets: bool,
    /// Distances of the cameras from the focus, in world units.
    pub distance: Spread,
    /// Distances of the axes from the focus, relative to the camera's distance; 1 where it lies behind.
    pub miss: Spread,
    /// One per view: the angle between axis and focus.
    pub off_rad: Vec<f64>,
    /// Share of the cameras with the focus in view.
    pub seeing: f64,
    /// Unit vector that points up, in world space.
    pub up: DVec3,
    /// How the cameras are arranged.
    pub arrangement: Arrangement,
}

/// How cameras are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Arrangement {
    /// There is one.
    Single,
    /// All look the same way.
    Parallel {
        /// Largest angle of an axis to their mean.
        within_degrees: f64,
    },
    /// All look about the same way.
    Facing {
        /// Largest angle of an axis to their mean.
        within_degrees: f64,
    },
    /// Around what they look at.
    Around {
        /// Degrees of azimuth, out of 360, without the largest gap.
        covered_degrees: f64,
        /// Least and largest angle above the focus, in degrees.
        elevation_degrees: [f64; 2],
    },
    /// Outwards, or past each other.
    Scattered,
}

/// Axes within this angle say little about where they meet.
const PARALLEL_DEGREES: f64 = 2.0;
/// Axes within this angle look from one side.
const FACING_DEGREES: f64 = 40.0;

/// Part of the pictures that are rolled on purpose now and then.
const MANY_ROLLED: f64 = 0.25;

impl ViewDirections {
    pub(super) fn of(scene: &CameraSet<'_>) -> Self {
        let focus = scene.focus.point;
        let cameras: Vec<_> = scene.cameras().cloned().collect();
        let up = Orbit::of(&cameras, focus).up;
        let off_rad: Vec<f64> = (scene.axes.iter())
            .map(|axis| {
                let (along, across) = axis.along_and_across(focus);
                across.atan2(along)
            })
            .collect();
        let miss = |off: &f64| if *off < 0.25 * TAU { off.sin() } else { 1.0 };
        let seeing = scene.axes.iter().filter(|axis| axis.sees(focus)).count();
        Self {
            focus,
            meets: scene.focus.kind == FocusKind::Crossing,
            distance: Spread::of(scene.axes.iter().map(|axis| axis.origin.distance(focus))),
            miss: Spread::of(off_rad.iter().map(miss)),
            off_rad,
            seeing: seeing as f64 / scene.count() as f64,
            up,
            arrangement: arrangement(scene, up),
        }
    }

    pub(super) fn findings(&self, scene: &CameraSet<'_>) -> Vec<Diagnostic> {
        let mut findings = Vec::new();
        if scene.count() == 1 || scene.dataset.train.len() == 1 {
            findings.push(Diagnostic::warning(
                "there is a single image to train on: without a second view nothing tells how far away things are; \
                 add photos from other places",
            ));
        }
        if scene.count() == 1 {
            return findings;
        }
        let extent = scene.extent();
        if scene.is_one_place() {
            findings.push(Diagnostic::warning(format!(
                "all {} cameras are at the same place: nothing tells how far away things are; check that \
                 `transform_matrix` is camera-to-world, with the position in its last column, or take photos from \
                 different places",
                scene.count()
            )));
        } else if self.meets && extent < 0.01 * self.distance.median {
            findings.push(Diagnostic::warning(format!(
                "the cameras are within {} of each other and look at a point {} away: so small a shift ({}) hardly \
                 tells distances; take photos from farther apart",
                length(2.0 * extent),
                length(self.distance.median),
                percent(2.0 * extent / self.distance.median)
            )));
        }
        findings.extend(guessed_box(scene));
        findings.extend(self.rolled(scene));
        findings
    }

    /// Many pictures that do not stand upright, in any world direction.
    fn rolled(&self, scene: &CameraSet<'_>) -> Option<Diagnostic> {
        let axes: Vec<_> = scene.cameras().map(|camera| camera.world_from_camera.matrix3).collect();
        // Where a camera looks up or down, its picture has no upright.
        let is_rolled = |view: usize| {
            let looks_level = axes[view].z_axis.dot(self.up).abs() < STEEP;
            looks_level && axes[view].y_axis.dot(self.up) < axes[view].x_axis.dot(self.up).abs()
        };
        let frames = scene.which(is_rolled);
        let many = frames.len() as f64 > MANY_ROLLED * scene.count() as f64;
        many.then(|| {
            let message = format!(
                "{} of {} are rolled by more than 45° from upright, as far as the others tell: {}; that is no harm where \
                 the camera was turned, but if the image files were turned after their poses were found, turn them back",
                frames.len(),
                count(scene.count(), "picture"),
                scene.names(&frames)
            );
            Diagnostic::note(message).about(frames)
        })
    }
}

/// What to do where nothing tells how far the scene reaches.
fn guessed_box(scene: &CameraSet<'_>) -> Option<Diagnostic> {
    let bounds = &scene.dataset.bounds;
    // A box that is stated around the ground below an aerial grid is worse than the one that is found.
    let (why, or_state_it) = match scene.focus.kind {
        _ if !bounds.is_guess => return None,
        FocusKind::Inside => (
            "the cameras have no common point in view, as in a room",
            ", or, if the result is foggy or empty, `aabb`: [[x, y, z], [x, y, z]], the corners of what the photos show, with \
             `aabb_scale`: 4 for what lies around it",
        ),
        _ => ("the optical axes do not cross", ""),
    };
    Some(Diagnostic::note(format!(
        "{why}, so how far away things are is not known before training, and the scene box is a guess: {} to each side \
         of {}; a point cloud (`ply_file_path`) or depth files would tell{or_state_it}",
        length(bounds.outer_half()),
        point(bounds.center, bounds.half),
    )))
}

fn arrangement(scene: &CameraSet<'_>, up: DVec3) -> Arrangement {
    if scene.count() == 1 {
        return Arrangement::Single;
    }
    let mean = scene.axes.iter().map(|axis| axis.direction).sum::<DVec3>();
    let angle = |direction: DVec3| direction.angle_between(mean).to_degrees();
    let within_degrees = match mean.length() > 1e-6 * scene.count() as f64 {
        true => scene.axes.iter().map(|axis| angle(axis.direction)).fold(0.0, f64::max),
        false => 180.0,
    };
    if within_degrees < PARALLEL_DEGREES {
        return Arrangement::Parallel { within_degrees };
    }
    if within_degrees < FACING_DEGREES {
        return Arrangement::Facing { within_degrees };
    }
    if !matches!(scene.focus.kind, FocusKind::Crossing | FocusKind::Origin) {
        return Arrangement::Scattered;
    }
    let (east, north) = up.any_orthonormal_pair();
    let from_focus: Vec<DVec3> =
        scene.axes.iter().map(|axis| (axis.origin - scene.focus.point).normalize_or_zero()).collect();
    let elevation = Spread::of(from_focus.iter().map(|d| d.dot(up).clamp(-1.0, 1.0).asin().to_degrees()));
    let mut azimuths: Vec<f64> =
        from_focus.iter().map(|d| d.dot(north).atan2(d.dot(east)).to_degrees()).collect();
    azimuths.sort_by(f64::total_cmp);
    let gaps = azimuths.windows(2).map(|pair| pair[1] - pair[0]);
    let around = azimuths.first().zip(azimuths.last()).map_or(360.0, |(first, last)| 360.0 + first - last);
    let covered_degrees = 360.0 - gaps.fold(around, f64::max);
    Arrangement::Around { covered_degrees, elevation_degrees: [elevation.min, elevation.max] }
}
