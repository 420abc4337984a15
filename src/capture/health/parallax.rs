//! Whether what the photos show lies beyond the scene box. Patches of small photos are looked for in others at all depths
//! (a plane sweep: Collins 1996, "A space-sweep approach to true multi-image matching"), and those are counted that fit best
//! farther away than where their ray leaves the box.

mod patch;
mod small_photo;

use super::Diagnostic;
use crate::camera::{Bounds, Camera, Geometry};
use crate::capture::dataset::{Dataset, evenly_spaced};
use crate::capture::scene_box::MAX_CASCADES;
use crate::photo::Photo;
use crate::support::format::percent;
use patch::{Patch, Sweep, Verdict};
use rayon::prelude::*;
use small_photo::SmallPhoto;
use std::collections::{HashMap, HashSet};
use std::sync::Mutex;

/// Photos whose patches are looked for,
const ANCHORS: usize = 8;
/// in so many others.
const PARTNERS: usize = 4;
/// Fewer patches that tell whether they are in the box tell nothing,
const ENOUGH: usize = 50;
/// and so does a smaller part of them beyond it.
const MUCH: f64 = 0.1;
/// A box that holds this part of them would do.
const NEARLY_ALL: f64 = 0.95;

/// A look at a few photos of a dataset, at most [`ParallaxSurvey::MOST_PHOTOS`] whatever their number.
#[derive(Debug)]
pub struct ParallaxSurvey {
    bounds: Bounds,
    /// Indices of frames whose patches are looked for, and of those where.
    groups: Vec<(usize, Vec<usize>)>,
    /// The cameras of all of these.
    cameras: HashMap<usize, Camera>,
    /// Those that were looked at.
    photos: Mutex<HashMap<usize, SmallPhoto>>,
}

/// Patches whose depth is clear enough to tell whether they are in the box.
#[derive(Clone, Debug, Default, PartialEq)]
struct Parallax {
    /// Number of those that are in the box.
    within: usize,
    /// How far boxes reach to each side that hold the others.
    beyond: Vec<f64>,
}

impl ParallaxSurvey {
    /// More photos are never looked at.
    pub const MOST_PHOTOS: usize = ANCHORS * (1 + PARTNERS);

    /// Chooses among some frames those that are worth a look.
    #[must_use]
    pub fn of(dataset: &Dataset, frames: &[usize], bounds: &Bounds) -> Self {
        Self::among(frames, |frame| &dataset.frames[frame].camera, bounds)
    }

    fn among<'a>(frames: &[usize], camera: impl Fn(usize) -> &'a Camera, bounds: &Bounds) -> Self {
        let groups: Vec<(usize, Vec<usize>)> = evenly_spaced(frames, ANCHORS)
            .into_iter()
            .map(|anchor| (anchor, partners(anchor, frames, &camera)))
            .filter(|(_, partners)| partners.len() >= patch::ENOUGH_VIEWS)
            .collect();
        let needed: HashSet<usize> =
            groups.iter().flat_map(|(anchor, others)| others.iter().chain([anchor])).copied().collect();
        let cameras = needed.into_iter().map(|index| (index, camera(index).clone())).collect();
        Self { bounds: bounds.clone(), groups, cameras, photos: Mutex::default() }
    }

    /// Looks at the photo of a frame, if it is one of those that were chosen. Photos that cannot be read are left out.
    pub fn look(&self, frame: usize, photo: &Photo) {
        let Some(camera) = self.cameras.get(&frame) else { return };
        let small = SmallPhoto::of(camera, photo);
        self.photos.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).insert(frame, small);
    }

    /// What is to be said of the photos that were looked at, where they show much that lies beyond the box.
    #[must_use]
    pub fn finding(&self) -> Option<Diagnostic> {
        self.parallax().finding(&self.bounds)
    }

    fn parallax(&self) -> Parallax {
        let photos = self.photos.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let group = |(anchor, others): &(usize, Vec<usize>)| {
            let anchor = photos.get(anchor)?;
            let others: Vec<&SmallPhoto> = others.iter().filter_map(|other| photos.get(other)).collect();
            Some((anchor, others))
        };
        let groups: Vec<_> = self.groups.iter().filter_map(group).collect();
        let judged = groups.par_iter().map(|(anchor, others)| {
            let Some(sweep) = Sweep::new(&anchor.camera, others, &self.bounds) else {
                return Parallax::default();
            };
            Parallax::of(Patch::all_of(anchor).iter().map(|patch| sweep.judge(patch)))
        });
        judged.reduce(Parallax::default, Parallax::and)
    }
}

impl Parallax {
    fn of(verdicts: impl Iterator<Item = Verdict>) -> Self {
        let mut found = Self::default();
        for verdict in verdicts {
            match verdict {
                Verdict::Unknown => {}
                Verdict::Within => found.within += 1,
                Verdict::Beyond(reach) => found.beyond.push(reach),
            }
        }
        found
    }

    fn and(mut self, other: Self) -> Self {
        self.within += other.within;
        self.beyond.extend(other.beyond);
        self
    }

    fn finding(&self, bounds: &Bounds) -> Option<Diagnostic> {
        let telling = self.within + self.beyond.len();
        let part = self.beyond.len() as f64 / telling.max(1) as f64;
        if telling < ENOUGH || part <= MUCH {
            return None;
        }
        let needed = self.needed();
        let [corners, scale] = statement(bounds, needed);
        let reach = bounds.outer_half();
        Some(Diagnostic::warning(format!(
            "{} of what the photos show seems to lie beyond the scene box, as far as parallax tells, and would become fog in \
             front of the cameras. The box, {}, reaches {} to each side of its centre, where about {} would do: write \
             `aabb`: {corners} and `aabb_scale`: {scale} into the file, or mask what is not to be shown",
            percent(part),
            bounds.source,
            figures(reach, reach, 3),
            figures(needed, needed, 2),
        )))
    }

    /// How far a box reaches to each side that holds nearly all, of which more than 0.1 is beyond.
    fn needed(&self) -> f64 {
        let mut reaches = self.beyond.clone();
        reaches.sort_by(f64::total_cmp);
        let left = (1.0 - NEARLY_ALL) * (self.within + reaches.len()) as f64;
        reaches[reaches.len() - 1 - (left as usize).min(reaches.len() - 1)]
    }
}

/// `aabb` and `aabb_scale` in a file, of a box about the same centre that reaches so far.
fn statement(bounds: &Bounds, needed: f64) -> [String; 2] {
    let doublings = (needed / bounds.outer_half()).log2().ceil().clamp(1.0, 64.0) as u32;
    let cascades = (bounds.cascades + doublings).min(MAX_CASCADES);
    let half = bounds.half * f64::from(bounds.cascades + doublings - cascades).exp2();
    let corner = |sign: f64| {
        let [x, y, z] = (bounds.center + sign * half).to_array().map(|value| figures(value, half, 3));
        format!("[{x}, {y}, {z}]")
    };
    [format!("[{}, {}]", corner(-1.0), corner(1.0)), (1u32 << (cascades - 1)).to_string()]
}

/// A number with as many decimals as `of` has for so many figures.
fn figures(number: f64, of: f64, figures: u32) -> String {
    let decimals = (f64::from(figures) - 1.0 - of.log10().floor()).clamp(0.0, 20.0) as usize;
    format!("{number:.decimals$}")
}

/// Photos from other places that may show the same: far away, but not turned away.
fn partners<'a>(anchor: usize, frames: &[usize], camera: impl Fn(usize) -> &'a Camera) -> Vec<usize> {
    let here = camera(anchor);
    // Parallel rays have no parallax from elsewhere, only from other directions.
    let half = 0.5 * f64::from(here.width) / here.focal_px.x;
    let half_view = match here.lens.geometry() {
        Geometry::Plane => half.atan(),
        Geometry::Angles => half,
        Geometry::Parallel => 0.0,
    };
    let worth = |frame: usize| {
        let there = camera(frame);
        let angle = there.forward().angle_between(here.forward());
        there.position().distance(here.position()) * (1.0 - angle / half_view)
    };
    let worths = frames.iter().map(|&frame| (worth(frame), frame));
    let mut others: Vec<(f64, usize)> = worths.filter(|(worth, _)| *worth > 0.0).collect();
    others.sort_by(|a, b| b.0.total_cmp(&a.0));
    others.into_iter().take(PARTNERS).map(|(_, frame)| frame).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Lens;
    use crate::photo::{Image, Pixels};
    use glam::{DAffine3, DVec2, DVec3};

    const SIZE: u32 = 96;

    /// Cameras beside each other in the plane z = 0 that look along -z.
    fn cameras(lens: Lens, focal_px: f64, apart: f64) -> Vec<Camera> {
        let pose = |at: u32| {
            DAffine3::from_translation(
                apart * DVec3::new(f64::from(at % 3) - 1.0, f64::from(at / 3) - 1.0, 0.0),
            )
        };
        let camera = |at| Camera {
            width: SIZE,
            height: SIZE,
            focal_px: DVec2::splat(focal_px),
            center_px: DVec2::splat(0.5 * f64::from(SIZE)),
            lens,
            world_from_camera: pose(at),
        };
        (0..9).map(camera).collect()
    }

    /// A photo of a wall at z = -5 with a pattern that does not repeat.
    fn photo(camera: &Camera, alpha: u8) -> Photo {
        let pixel = |index: u32| {
            let at = DVec2::new(f64::from(index % SIZE), f64::from(index / SIZE)) + 0.5;
            let wall = camera.ray(at).filter(|ray| ray.direction.z < 0.0).map(|ray| {
                let place = ray.origin - ray.direction * ((ray.origin.z + 5.0) / ray.direction.z);
                let waves = [[3.1, 1.7], [-2.3, 4.1], [5.3, 2.9], [0.7, -1.1]];
                waves.iter().map(|[x, y]| (x * place.x + y * place.y).sin()).sum::<f64>()
            });
            let value = (128.0 + 30.0 * wall.unwrap_or(0.0)) as u8;
            [value, value, value, alpha]
        };
        let pixels = Pixels::Srgb8((0..SIZE * SIZE).map(pixel).collect());
        Image { width: SIZE, height: SIZE, pixels, has_alpha: alpha < 255 }.into()
    }

    fn bounds(center: DVec3, half: f64, cascades: u32) -> Bounds {
        Bounds { center, half, cascades, source: "stated here".into(), is_guess: false }
    }

    fn parallax(cameras: &[Camera], bounds: &Bounds, photo: impl Fn(&Camera) -> Photo) -> Parallax {
        let frames: Vec<usize> = (0..cameras.len()).collect();
        let survey = ParallaxSurvey::among(&frames, |frame| &cameras[frame], bounds);
        frames.iter().for_each(|&frame| survey.look(frame, &photo(&cameras[frame])));
        survey.parallax()
    }

    fn opaque(camera: &Camera) -> Photo {
        photo(camera, 255)
    }

    #[test]
    fn a_wall_beyond_the_box_is_told_with_a_box_that_holds_it() {
        let cameras = cameras(Lens::Pinhole, 90.0, 0.5);
        let small = bounds(DVec3::new(0.25, 0.0, -0.5), 1.0, 2);
        let found = parallax(&cameras, &small, opaque);
        let all = found.within + found.beyond.len();
        assert!(all > 300 && found.within == 0, "{} of {all}", found.within);
        assert!((found.needed() / 4.5 - 1.0).abs() < 0.1, "{}", found.needed());
        let said = found.finding(&small).expect("a finding").message;
        assert!(
            said.starts_with("100 % of what the photos show seems to lie beyond the scene box"),
            "{said}"
        );
        let remedy =
            "write `aabb`: [[-0.75, -1.00, -1.50], [1.25, 1.00, 0.50]] and `aabb_scale`: 8 into the file";
        assert!(said.contains("stated here, reaches 2.00 to each side") && said.contains(remedy), "{said}");
        let large = bounds(small.center, 1.0, 4);
        let found = parallax(&cameras, &large, opaque);
        assert!(found.within > 300 && found.beyond.is_empty(), "{found:?}");
        assert_eq!(found.finding(&large), None);
    }

    #[test]
    fn every_lens_with_parallax_tells() {
        let small = bounds(DVec3::ZERO, 2.0, 1);
        let sphere = f64::from(SIZE) / std::f64::consts::TAU;
        for (lens, focal_px) in [
            (Lens::OpenCv { k: [-0.1, 0.02, 0.0, 0.0], p: [1e-3, 0.0] }, 90.0),
            (Lens::Fisheye { k: [0.0; 4] }, 60.0),
            (Lens::Equirectangular, sphere),
        ] {
            let found = parallax(&cameras(lens, focal_px, 1.0), &small, opaque);
            assert!(
                found.beyond.len() > 9 * found.within && found.beyond.len() >= ENOUGH,
                "{lens:?}: {found:?}"
            );
        }
        let parallel = parallax(&cameras(Lens::Orthographic, 9.0, 1.0), &small, opaque);
        assert_eq!(parallel, Parallax::default());
    }

    #[test]
    fn what_tells_nothing_is_not_told() {
        let small = bounds(DVec3::ZERO, 2.0, 1);
        let apart = cameras(Lens::Pinhole, 90.0, 0.5);
        let is_silent =
            |found: Parallax| assert_eq!((found.finding(&small), found), (None, Parallax::default()));
        is_silent(parallax(&cameras(Lens::Pinhole, 90.0, 0.0), &small, opaque));
        is_silent(parallax(&cameras(Lens::Pinhole, 90.0, 1e-9), &small, opaque));
        is_silent(parallax(&apart[..2], &small, opaque));
        is_silent(parallax(&[], &small, opaque));
        is_silent(parallax(&apart, &small, |camera| photo(camera, 100)));
        let ignored = vec![true; (SIZE * SIZE) as usize];
        is_silent(parallax(&apart, &small, |camera| Photo { ignored: ignored.clone(), ..opaque(camera) }));
        is_silent(parallax(&apart, &small, |_| {
            let pixels = Pixels::Srgb8(vec![[90, 91, 92, 255]; (SIZE * SIZE) as usize]);
            Image { width: SIZE, height: SIZE, pixels, has_alpha: false }.into()
        }));
        // A wall 5 away, with a box that reaches a thousand times as far as parallax.
        is_silent(parallax(&apart, &bounds(DVec3::ZERO, 1e5, 1), opaque));
    }

    #[test]
    fn boxes_double_as_far_as_there_are_cascades() {
        let of = |cascades, needed| statement(&bounds(DVec3::splat(500_000.0), 0.5, cascades), needed);
        assert_eq!(of(1, 0.6)[1], "2");
        assert_eq!(of(3, 9.0)[1], "32", "from 2 over 4 and 8 to 16");
        let [corners, scale] = of(8, 1000.0);
        assert_eq!(scale, "128");
        let corner = |value| format!("[{value}, {value}, {value}]");
        assert_eq!(corners, format!("[{}, {}]", corner("499992.00"), corner("500008.00")));
        assert_eq!(of(8, f64::INFINITY)[1], "128");
    }
}
