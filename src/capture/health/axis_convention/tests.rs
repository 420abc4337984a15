//! Captures of many kinds, read rightly and in three wrong ways: who is warned.

use super::*;
use crate::camera::Lens;
use crate::capture::diagnostics::Severity;
use glam::{DQuat, DVec2, dvec3};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Repeatable numbers in `[-1, 1]`.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1u32 << 30) - 1.0
    }

    fn vector(&mut self) -> DVec3 {
        dvec3(self.next(), self.next(), self.next())
    }
}

/// Camera-to-world of a camera at `from`, whose view is `heading` from +x towards +y, `tilt` upwards, and that is rolled;
/// z points up.
fn pose(from: DVec3, heading: f64, tilt: f64, roll: f64) -> DAffine3 {
    let forward = dvec3(tilt.cos() * heading.cos(), tilt.cos() * heading.sin(), tilt.sin());
    let right = dvec3(heading.sin(), -heading.cos(), 0.0);
    let level = DMat3::from_cols(right, right.cross(forward), -forward);
    DAffine3::from_mat3_translation(level * DMat3::from_rotation_z(roll), from)
}

/// One that looks at a point.
fn toward(from: DVec3, at: DVec3) -> DAffine3 {
    let view = at - from;
    pose(from, view.y.atan2(view.x), view.z.atan2(view.truncate().length()), 0.0)
}

/// A camera on a sphere.
fn on_sphere(radius: f64, azimuth: f64, elevation: f64) -> DVec3 {
    radius * dvec3(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin())
}

fn turn(index: usize, count: usize) -> f64 {
    TAU * index as f64 / count as f64
}

/// Camera-to-world poses by the name of their capture.
type Captures = Vec<(&'static str, Vec<DAffine3>)>;

/// Captures of something in the middle, about the origin in a world whose z points up.
fn inward(noise: &mut Noise) -> Captures {
    let ring = |elevation: f64, count: usize| -> Vec<DAffine3> {
        (0..count).map(|i| toward(on_sphere(4.0, turn(i, count), elevation), DVec3::ZERO)).collect()
    };
    let mut hemisphere = || {
        let elevation = (0.5 + 0.45 * noise.next()).asin();
        toward(on_sphere(4.0, PI * noise.next(), elevation), DVec3::ZERO)
    };
    vec![
        ("hemisphere", (0..60).map(|_| hemisphere()).collect()),
        ("high ring", ring(0.6, 36)),
        ("low ring", ring(0.3, 36)),
        ("three rings", [0.2, 0.5, 0.8].into_iter().flat_map(|e| ring(e, 16)).collect()),
        ("half a ring", ring(0.4, 48)[..24].to_vec()),
        ("portrait ring", ring(0.5, 24).into_iter().map(|p| p * rolled(FRAC_PI_2)).collect()),
    ]
}

fn rolled(angle: f64) -> DAffine3 {
    DAffine3::from_quat(DQuat::from_rotation_z(angle))
}

/// Captures that look outwards or ahead, in a world whose z points up.
fn outward(noise: &mut Noise) -> Captures {
    let mut sets: Captures = Vec::new();
    for (name, radius, tilt, roll) in [
        ("room", 0.25, 0.3, 0.0),
        ("level room", 0.25, 0.0, 0.0),
        ("room in hands", 0.3, 0.25, 0.26),
        ("portrait room", 0.3, 0.25, FRAC_PI_2),
    ] {
        let camera = |i: usize, noise: &mut Noise| {
            let heading = turn(i, 40);
            let place = dvec3(0.2, 0.1, 1.5) + radius * dvec3(heading.cos(), heading.sin(), 0.0);
            let roll = if roll == FRAC_PI_2 { roll + 0.1 * noise.next() } else { roll * noise.next() };
            pose(place + 0.2 * radius * noise.vector(), heading, tilt * noise.next(), roll)
        };
        sets.push((name, (0..40).map(|i| camera(i, noise)).collect()));
    }
    for (name, place, radius) in [
        ("panorama", dvec3(0.0, 0.0, 1.6), 0.0),
        ("panorama aside", dvec3(2.0, -1.0, 1.6), 0.0),
        ("ball of cameras", dvec3(0.0, 0.0, 1.7), 0.1),
        ("drone's sphere", dvec3(3.0, 8.0, 40.0), 0.3),
    ] {
        let rows = [-1.2, -0.7, -0.2, 0.3];
        let camera =
            |(row, i): (f64, usize)| pose(place + on_sphere(radius, turn(i, 12), row), turn(i, 12), row, 0.0);
        sets.push((
            name,
            rows.into_iter().flat_map(|row| (0..12).map(move |i| (row, i))).map(camera).collect(),
        ));
    }
    for (name, place, radius, lowest, highest) in [
        ("dome", dvec3(0.0, 0.0, 1.6), 0.0, 0.2, 1.4),
        ("dome around", dvec3(0.0, 0.0, 1.6), 0.1, 0.2, 1.4),
        ("well", dvec3(0.0, 0.0, 10.0), 0.0, -1.4, -0.2),
        ("well around", dvec3(0.0, 0.0, 10.0), 0.1, -1.4, -0.2),
        ("two rows", dvec3(0.0, 0.0, 1.6), 0.2, -0.25, 0.25),
    ] {
        let camera = |i: usize, noise: &mut Noise| {
            let tilt = match name {
                "two rows" => [lowest, highest][i % 2],
                _ => lowest + (highest - lowest) * (0.5 + 0.5 * noise.next()),
            };
            pose(place + on_sphere(radius, turn(i, 48), tilt), turn(i, 48), tilt, 0.0)
        };
        sets.push((name, (0..48).map(|i| camera(i, noise)).collect()));
    }
    let facing = |i: usize, noise: &mut Noise| {
        pose(
            dvec3(0.1 * noise.next(), (i % 6) as f64 - 2.5, 0.5 * (i / 6) as f64),
            0.1 * noise.next(),
            0.1 * noise.next(),
            0.02 * noise.next(),
        )
    };
    sets.push(("facing", (0..36).map(|i| facing(i, noise)).collect()));
    let corridor = |i: usize, noise: &mut Noise| {
        pose(
            dvec3(0.3 * i as f64, 0.1 * noise.next(), 1.6),
            0.15 * noise.next(),
            0.1 * noise.next(),
            0.05 * noise.next(),
        )
    };
    sets.push(("corridor", (0..40).map(|i| corridor(i, noise)).collect()));
    let walk = |i: usize, noise: &mut Noise| {
        let way = dvec3(0.5 * i as f64, (0.2 * i as f64).sin(), 1.6);
        pose(way, 0.3 * (0.2 * i as f64).cos() + 0.6 * noise.next(), 0.15 * noise.next(), 0.1 * noise.next())
    };
    sets.push(("walk", (0..40).map(|i| walk(i, noise)).collect()));
    let there_and_back = |i: usize, noise: &mut Noise| {
        let heading = if i < 20 { 0.0 } else { PI };
        pose(
            dvec3(0.5 * (i % 20) as f64, 0.05 * noise.next(), 1.6),
            heading + 0.2 * noise.next(),
            0.1 * noise.next(),
            0.0,
        )
    };
    sets.push(("there and back", (0..40).map(|i| there_and_back(i, noise)).collect()));
    let rig = |i: usize, noise: &mut Noise| {
        let place = dvec3(0.5 * (i / 6) as f64, 0.1 * noise.next(), 1.7);
        match i % 6 {
            4 => pose(place, 0.0, FRAC_PI_2, 0.0),
            5 => pose(place, 0.0, -FRAC_PI_2, 0.0),
            side => pose(place, FRAC_PI_2 * side as f64, 0.0, 0.0),
        }
    };
    sets.push(("six-sided rig", (0..60).map(|i| rig(i, noise)).collect()));
    for (name, heading, spread) in
        [("nadir grid", 0.0, 0.03), ("slanting nadir grid", 0.6, 0.03), ("turning nadir grid", 0.0, PI)]
    {
        let camera = |i: usize, noise: &mut Noise| {
            let place = dvec3(5.0 * (i % 6) as f64, 5.0 * (i / 6) as f64, 60.0 + noise.next());
            let back = if (i / 6).is_multiple_of(2) { 0.0 } else { PI };
            pose(place, heading + back + spread * noise.next(), -FRAC_PI_2 + 0.05 * noise.next(), 0.0)
        };
        sets.push((name, (0..36).map(|i| camera(i, noise)).collect()));
    }
    sets
}

fn world_to_camera(pose: DAffine3) -> DAffine3 {
    pose.inverse()
}

/// How a pose comes to be in a file.
type Write = fn(DAffine3) -> DAffine3;

const WRITTEN: [(&str, Write); 4] = [
    ("right", |pose| pose),
    ("OpenCV", from_open_cv),
    ("inverse", world_to_camera),
    ("inverse OpenCV", |pose| from_open_cv(pose).inverse()),
];

/// Worlds whose z, y, -y and x point up, and one that nobody aligned.
fn worlds() -> [(&'static str, DAffine3); 5] {
    let from_z = |up: DVec3| DAffine3::from_quat(DQuat::from_rotation_arc(DVec3::Z, up));
    let tilt = DQuat::from_rotation_x(0.5) * DQuat::from_rotation_y(-0.35);
    let tilted = DAffine3::from_rotation_translation(tilt, dvec3(0.7, -2.0, 1.1));
    [
        ("z up", from_z(DVec3::Z)),
        ("y up", from_z(DVec3::Y)),
        ("-y up", from_z(DVec3::NEG_Y)),
        ("x up", from_z(DVec3::X)),
        ("tilted", tilted),
    ]
}

fn camera(pose: DAffine3) -> Camera {
    Camera {
        width: 64,
        height: 48,
        focal_px: DVec2::splat(46.7),
        center_px: DVec2::new(32.0, 24.0),
        lens: Lens::Pinhole,
        world_from_camera: pose,
    }
}

/// How much is said about poses, and which convention is named.
fn said(poses: &[DAffine3]) -> Option<(Severity, &'static str)> {
    let cameras: Vec<Camera> = poses.iter().map(|&pose| camera(pose)).collect();
    let axes: Vec<OpticalAxis> = cameras.iter().map(OpticalAxis::of).collect();
    let focus = find(&axes);
    let seeing = axes.iter().filter(|axis| axis.sees(focus.point)).count() as f64 / axes.len() as f64;
    if !is_doubtful(&focus, seeing) {
        return None;
    }
    let suspicion = suspect(&cameras.iter().collect::<Vec<_>>())?;
    Some((suspicion.severity, suspicion.convention.name))
}

/// The captures of a kind in every world, written in every way, with poses as inexact as those found from photos.
fn each(captures: fn(&mut Noise) -> Captures, judge: impl Fn(&str, usize, Option<(Severity, &str)>, &str)) {
    let mut noise = Noise(0);
    let sets = captures(&mut noise);
    for ((name, poses), (world, aligned)) in sets.iter().flat_map(|set| worlds().map(|world| (set, world))) {
        for (way, (written, write)) in WRITTEN.into_iter().enumerate() {
            let mut inexact = |pose: &DAffine3| {
                let turn = DQuat::from_scaled_axis(0.02 * noise.vector());
                let place = pose.translation + 0.01 * noise.vector();
                write(aligned * DAffine3::from_mat3_translation(DMat3::from_quat(turn) * pose.matrix3, place))
            };
            let poses: Vec<_> = poses.iter().map(&mut inexact).collect();
            judge(world, way, said(&poses), &format!("{name}, {world}, {written}"));
        }
    }
}

#[test]
fn captures_of_something_are_told_how_they_are_misread() {
    each(inward, |world, way, said, which| {
        let (severity, name) = match way {
            0 => return assert_eq!(said, None, "{which}"),
            1 if world == "z up" && !which.starts_with("portrait") => {
                (Severity::Warning, CONVENTIONS[0].name)
            }
            // In a world that may stand on its head, these may have looked outwards.
            1 => (Severity::Note, CONVENTIONS[0].name),
            _ => (Severity::Warning, CONVENTIONS[way - 1].name),
        };
        assert_eq!(said, Some((severity, name)), "{which}");
    });
}

#[test]
fn nobody_who_looked_outwards_is_warned() {
    each(outward, |world, way, said, which| {
        if let (0, Some((severity, name))) = (way, said) {
            assert_eq!(severity, Severity::Note, "{which}");
            assert!(name == CONVENTIONS[0].name || world == "x up", "{which}: {name}");
        }
    });
}
