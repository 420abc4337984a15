//! The part of the world that is modelled: a cube, found from the cameras or taken from the file.

use glam::DVec3;

use super::dataset::SceneBox;
use super::dataset::notes::Notes;
use super::focus::{Focus, FocusKind, OpticalAxis, find, median};
use super::surfaces::{Extent, Surfaces};
use crate::camera::{Bounds, Camera, Ray};

/// What is known about the surroundings of the subject.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Surroundings {
    /// The images are cut out: nothing but the subject.
    Empty,
    /// Opaque images: the background is part of the scene.
    Background,
    /// No image to look at.
    Unknown,
}

pub(super) const MAX_CASCADES: u32 = 8;
/// Surfaces around cameras that look outwards are no farther away than so many times the cameras from their middle, as a
/// rule: people turn round within a metre, in rooms and in yards.
const INSIDE: f64 = 120.0;
/// What is known to reach so far needs a little more.
const MARGIN: f64 = 1.1;

impl Bounds {
    /// The box of the file where it holds what the cameras look at, else the box found from the cameras.
    pub(super) fn choose(
        cameras: &[&Camera],
        scene_box: Option<SceneBox>,
        surroundings: Surroundings,
        surfaces: impl FnOnce(&mut Notes) -> Option<Surfaces>,
        notes: &mut Notes,
    ) -> Self {
        let axes: Vec<OpticalAxis> = cameras.iter().map(|camera| OpticalAxis::of(camera)).collect();
        let focus = find(&axes);
        if let Some(scene_box) = scene_box {
            let stated = Self::stated(scene_box);
            let Some(reason) = stated.misses(&axes, &focus) else { return stated };
            notes.warn(format!(
                "the scene box in the file (center {:.4}, half side {:.4}) is not used: {reason}; \
                 the box found from the cameras is",
                stated.center,
                stated.outer_half()
            ));
        }
        let found = Self::found(&axes, &focus, surroundings);
        if !found.is_guess {
            return found;
        }
        let surfaces = surfaces(notes);
        let around = surfaces.and_then(|surfaces| Self::around(&surfaces, &axes, surroundings));
        around.unwrap_or(found)
    }

    /// The box around surfaces that are known, and the cameras that see them.
    fn around(surfaces: &Surfaces, axes: &[OpticalAxis], surroundings: Surroundings) -> Option<Self> {
        let Extent { center, half, reach } = surfaces.extent()?;
        let cameras = axes.iter().map(|axis| (axis.origin - center).abs().max_element());
        let (half, reach) = (MARGIN * half, MARGIN * cameras.fold(reach, f64::max));
        let is_object = surroundings == Surroundings::Empty;
        Some(Self {
            center,
            half: if is_object { reach.max(half) } else { half },
            // Behind what is known there may be more.
            cascades: if is_object { 1 } else { doublings(half, reach).clamp(1, MAX_CASCADES - 1) + 1 },
            source: format!("found around {}", surfaces.source),
            is_guess: false,
        })
    }

    fn stated(scene_box: SceneBox) -> Self {
        let SceneBox { scale, offset, aabb_scale } = scene_box;
        Self {
            center: (DVec3::splat(0.5) - offset) / scale,
            half: 0.5 / scale,
            cascades: aabb_scale.trailing_zeros() + 1,
            source: format!("stated in the file (aabb_scale {aabb_scale}, scale {scale:.4})"),
            is_guess: false,
        }
    }

    /// Why this box cannot be meant for these cameras. Exporters write the same box whatever the units.
    fn misses(&self, axes: &[OpticalAxis], focus: &Focus) -> Option<String> {
        // What the cameras look at may lie a little off the inner cube where there are more around it.
        let core = f64::min(2.0 * self.half, self.outer_half());
        let off = (focus.point - self.center).abs().max_element();
        if focus.kind != FocusKind::Ahead && off > core {
            return Some(format!("the cameras look at {:.4}, outside of it", focus.point));
        }
        let footprint = footprint(axes, focus);
        if footprint > 2.0 * self.outer_half() {
            return Some(format!("the cameras see {footprint:.4} to each side, far more than it holds"));
        }
        // Any finer detail would be lost in so large a cube.
        if focus.kind != FocusKind::Inside && footprint < self.half / 32.0 {
            return Some(format!("the cameras see {footprint:.4} to each side, a tiny part of it"));
        }
        let hits = axes.iter().filter(|axis| self.is_hit_by(axis)).count();
        (2 * hits < axes.len()).then(|| format!("only {hits} of {} cameras look into it", axes.len()))
    }

    fn is_hit_by(&self, axis: &OpticalAxis) -> bool {
        self.meets(self.outer_half(), &Ray { origin: axis.origin, direction: axis.direction })
    }

    fn found(axes: &[OpticalAxis], focus: &Focus, surroundings: Surroundings) -> Self {
        let whose = match focus.kind {
            FocusKind::Crossing => "around the point the cameras look at",
            FocusKind::Origin => "around the origin, which the cameras see; their axes do not cross",
            FocusKind::Ahead => "ahead of the cameras, whose axes do not cross; the distance is a guess",
            FocusKind::Inside => "around the cameras, which have no common point in view",
        };
        let is_object = match surroundings {
            Surroundings::Empty => focus.kind != FocusKind::Inside,
            Surroundings::Background => false,
            Surroundings::Unknown => is_orbit(axes, focus),
        };
        if is_object {
            return Self {
                center: focus.point,
                half: footprint(axes, focus),
                cascades: 1,
                source: format!("found {whose}, as wide as their view; no background"),
                is_guess: focus.kind == FocusKind::Ahead,
            };
        }
        let distance = focus.distance;
        let half = match focus.kind {
            FocusKind::Inside => 2.0 * distance,
            // The subject, and at least half the way to the cameras: the foreground needs detail too.
            _ => footprint(axes, focus).clamp(0.5 * distance, distance),
        };
        let farthest = axes.iter().map(|axis| axis.origin - focus.point);
        let farthest = farthest.map(|d| d.abs().max_element()).fold(0.0, f64::max);
        let (reach, how_far) = match focus.kind {
            // How far away what they look at is, only their pictures could tell.
            FocusKind::Inside => {
                (f64::max(INSIDE * distance, 0.5 * INSIDE * farthest), "far beyond them, which is a guess")
            }
            // Cameras on their way see what lies ahead of it.
            FocusKind::Ahead => (f64::max(5.0 * distance, 4.0 * farthest), "well beyond them"),
            _ => (f64::max(5.0 * distance, 2.0 * farthest), "well behind them"),
        };
        Self {
            center: focus.point,
            half,
            cascades: (doublings(half, reach) + 1).min(MAX_CASCADES),
            source: format!("found {whose}, doubled until it reaches {how_far}"),
            is_guess: matches!(focus.kind, FocusKind::Ahead | FocusKind::Inside),
        }
    }
}

/// How often half a side must be doubled to reach so far.
fn doublings(half: f64, reach: f64) -> u32 {
    (reach / half).log2().ceil().max(0.0) as u32
}

/// Half the width of the typical view at the focus, in world units.
fn footprint(axes: &[OpticalAxis], focus: &Focus) -> f64 {
    match focus.kind {
        FocusKind::Inside => median(axes.iter().map(|axis| axis.half_width_at(focus.distance))),
        _ => median((axes.iter()).map(|axis| axis.half_width_at(axis.origin.distance(focus.point)))),
    }
}

/// Whether the cameras circle the focus at about one distance, as object captures do.
fn is_orbit(axes: &[OpticalAxis], focus: &Focus) -> bool {
    let distances = axes.iter().map(|axis| axis.origin.distance(focus.point));
    let even = { distances }.all(|d| (d / focus.distance - 1.0).abs() < 0.25);
    match focus.kind {
        FocusKind::Crossing => even && axes.len() >= 3,
        FocusKind::Origin => true,
        FocusKind::Ahead | FocusKind::Inside => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Lens;
    use glam::{DAffine3, DVec2};

    fn looking(from: DVec3, at: DVec3, angle_rad: f64) -> Camera {
        let back = (from - at).normalize();
        let right = DVec3::new(0.01, 0.02, 1.0).cross(back).normalize();
        let world_from_view = DAffine3::from_cols(right, back.cross(right), back, from);
        Camera {
            width: 100,
            height: 80,
            focal_px: DVec2::splat(50.0 / (0.5 * angle_rad).tan()),
            center_px: DVec2::new(50.0, 40.0),
            lens: Lens::Pinhole,
            world_from_camera: world_from_view,
        }
    }

    /// Two rings of twelve cameras around a point, with slightly different aims.
    fn ring(center: DVec3, distance: f64, angle_rad: f64) -> Vec<Camera> {
        let camera = |i: u32| {
            let (turn, lift) = (f64::from(i) * 0.55, if i < 12 { 0.3 } else { 0.8f64 });
            let out = DVec3::new(lift.cos() * turn.cos(), lift.cos() * turn.sin(), lift.sin());
            let aim = 0.01 * distance * DVec3::new((3.0 * turn).sin(), (5.0 * turn).cos(), 0.0);
            looking(center + distance * out, center + aim, angle_rad)
        };
        (0..24).map(camera).collect()
    }

    fn choose(cameras: &[Camera], file: Option<SceneBox>, around: Surroundings) -> (Bounds, usize) {
        let mut notes = Notes::default();
        let cameras: Vec<_> = cameras.iter().collect();
        let bounds = Bounds::choose(&cameras, file, around, |_| None, &mut notes);
        (bounds, notes.finish().len())
    }

    fn scene_box(aabb_scale: u32) -> Option<SceneBox> {
        Some(SceneBox { scale: 0.33, offset: DVec3::splat(0.5), aabb_scale })
    }

    #[test]
    fn objects_fill_the_box_at_any_place_scale_and_lens() {
        for (center, distance, angle) in [
            (DVec3::ZERO, 4.03, 0.691),
            (DVec3::new(13.0, 13.0, 5.0), 8.0, 0.691),
            (DVec3::ZERO, 67.0, 0.0684),
            (DVec3::new(3e-4, 0.0, 1e-4), 4e-4, 0.8),
            (DVec3::new(2e6, -1e6, 0.0), 4e6, 0.8),
            (DVec3::new(5e5, 4e6, 120.0), 30.0, 0.8),
        ] {
            let cameras = ring(center, distance, angle);
            let (bounds, _) = choose(&cameras, None, Surroundings::Empty);
            let expected = distance * (0.5f64 * angle).tan();
            assert!((bounds.half / expected - 1.0).abs() < 0.02, "{bounds:?}");
            assert!(bounds.center.distance(center) < 0.02 * distance, "{bounds:?}");
            assert_eq!(bounds.cascades, 1);
            let unseen = choose(&cameras, None, Surroundings::Unknown).0;
            assert_eq!(unseen, bounds);
        }
    }

    #[test]
    fn other_lenses_fill_the_box_too() {
        let with = |lens: Lens, focal_px: f64| {
            let cameras = ring(DVec3::ONE, 4.0, 0.8).into_iter();
            let cameras: Vec<_> =
                cameras.map(|camera| Camera { lens, focal_px: DVec2::splat(focal_px), ..camera }).collect();
            choose(&cameras, None, Surroundings::Empty).0
        };
        // 100 pixels: 2 units to each side at any distance, and half a radian to each side.
        assert!((with(Lens::Orthographic, 25.0).half - 2.0).abs() < 0.02);
        assert!((with(Lens::Fisheye { k: [0.0; 4] }, 100.0).half - 4.0 * 0.5f64.tan()).abs() < 0.04);
        // A whole sphere is seen from a box that reaches to the cameras.
        assert!((with(Lens::Equirectangular, 100.0 / std::f64::consts::TAU).half - 4.0).abs() < 0.04);
        // Parallel views side by side overlap at any distance.
        let place = |i: i32| DVec3::new(f64::from(i), 100.0, 3.0);
        let parallel = |camera: Camera| Camera { lens: Lens::Orthographic, ..camera };
        let array: Vec<_> = (-3..=3).map(|i| parallel(looking(place(i), place(i) + DVec3::Y, 0.7))).collect();
        let (bounds, _) = choose(&array, None, Surroundings::Background);
        assert!(bounds.center.is_finite() && bounds.half.is_finite() && bounds.half > 0.0, "{bounds:?}");
    }

    #[test]
    fn backgrounds_are_taken_in() {
        for (distance, angle) in [(4.0, 1.2), (4e-4, 0.8), (67.0, 0.0684), (5.0, 2.4)] {
            let cameras = ring(DVec3::new(1.0, 2.0, 3.0), distance, angle);
            let (bounds, _) = choose(&cameras, None, Surroundings::Background);
            assert!(bounds.half >= 0.49 * distance && bounds.half <= 1.02 * distance, "{bounds:?}");
            let reach = bounds.outer_half() / distance;
            assert!((5.0 * 0.98..11.0).contains(&reach), "{bounds:?}");
        }
    }

    #[test]
    fn stray_cameras_do_not_move_the_focus() {
        let mut cameras = ring(DVec3::ONE, 4.0, 0.8);
        for i in 0..4 {
            let away = DVec3::new(9.0, f64::from(i), 20.0);
            cameras[6 * i as usize] = looking(away, 3.0 * away + DVec3::X, 0.8);
        }
        let (bounds, _) = choose(&cameras, None, Surroundings::Empty);
        assert!(bounds.center.distance(DVec3::ONE) < 0.1, "{bounds:?}");
    }

    #[test]
    fn without_crossing_axes_there_is_still_a_box() {
        let one = [looking(DVec3::new(0.0, -4.0, 0.0), DVec3::ZERO, 0.7)];
        let (bounds, _) = choose(&one, None, Surroundings::Empty);
        assert!(bounds.center.length() < 1e-9 && (bounds.half - 1.46).abs() < 0.01);
        let lost = [looking(DVec3::ZERO, -DVec3::Y, 0.7)];
        let (bounds, _) = choose(&lost, None, Surroundings::Background);
        assert!(bounds.center.distance(-DVec3::Y) < 1e-9 && bounds.half > 0.3);
        // A camera array: the views must overlap where the box is.
        let place = |i: i32| DVec3::new(f64::from(i), 100.0, 3.0);
        let array: Vec<_> = (-3..=3).map(|i| looking(place(i), place(i) + DVec3::Y, 0.7)).collect();
        let (bounds, _) = choose(&array, None, Surroundings::Background);
        assert!(bounds.center.distance(DVec3::new(0.0, 116.4, 3.0)) < 0.1, "{bounds:?}");
        // On the way along a corridor, which is not as narrow as rounding.
        for wiggle in [0.0, 1e-13, 1e-3, 0.01] {
            let place = |i: i32| DVec3::new(wiggle * f64::from(i % 2), 0.05 * f64::from(i), 0.0);
            let dolly: Vec<_> = (-24..=24).map(|i| looking(place(i), place(i) + DVec3::Y, 1.2)).collect();
            let (bounds, _) = choose(&dolly, None, Surroundings::Background);
            assert!(bounds.is_guess && (4.0..20.0).contains(&bounds.outer_half()), "{wiggle}: {bounds:?}");
        }
        // A quarter of a pan shows as much of a room as all of it does.
        for half_pan in [0.45, 0.8, 2.0] {
            let out = |i: i32| {
                let turn = half_pan * f64::from(i) / 20.0;
                DVec3::new(turn.cos(), turn.sin(), 0.1)
            };
            let pan: Vec<_> = (-20..=20).map(|i| looking(0.25 * out(i), out(i), 1.2)).collect();
            let (bounds, _) = choose(&pan, None, Surroundings::Background);
            let spread = 0.25 * half_pan.min(1.0);
            assert!(bounds.is_guess && bounds.outer_half() > 60.0 * 0.5 * spread, "{half_pan}: {bounds:?}");
        }
        // A room seen from its middle, and a panorama from one point.
        for step in [0.5, 0.0] {
            let room: Vec<_> = ring(DVec3::ZERO, step, 1.0)
                .iter()
                .enumerate()
                .map(|(i, camera)| {
                    let turn = 0.55 * i as f64;
                    let out = DVec3::new(turn.cos(), turn.sin(), 0.3 * (3.0 * turn).sin());
                    let from = if step > 0.0 { camera.position() } else { DVec3::ZERO };
                    looking(from, from + out, 1.0)
                })
                .collect();
            let (bounds, _) = choose(&room, None, Surroundings::Background);
            assert!(bounds.center.length() < 0.5 && bounds.half.is_finite(), "{bounds:?}");
            assert!(bounds.half >= 2.0 * step * 0.9 && bounds.cascades > 1, "{bounds:?}");
        }
    }

    #[test]
    fn the_box_of_the_file_counts_unless_it_misses() {
        let fits = choose(&ring(DVec3::ZERO, 4.0, 0.9), scene_box(4), Surroundings::Background);
        assert_eq!((fits.0.cascades, fits.1), (3, 0));
        assert!((fits.0.half - 0.5 / 0.33).abs() < 1e-12 && fits.0.center.length() < 1e-12);
        assert!((fits.0.max().x - 2.0 / 0.33).abs() < 1e-9);
        for (center, distance) in
            [(DVec3::new(13.0, 13.0, 5.0), 8.0), (DVec3::ZERO, 4000.0), (DVec3::ZERO, 0.004)]
        {
            let cameras = ring(center, distance, 0.691);
            let (bounds, notes) = choose(&cameras, scene_box(16), Surroundings::Empty);
            assert_eq!((bounds.cascades, notes), (1, 1), "{bounds:?}");
        }
    }
}
