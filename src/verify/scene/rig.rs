//! Where the cameras of a generated dataset stand and what their lenses are.

use super::{Scene, SceneOptions};
use crate::camera::{Camera, Lens, LensKind};
use crate::photo::Split;
use glam::{DAffine3, DMat3, DVec2, DVec3, dvec2, dvec3};
use std::f64::consts::TAU;

/// Horizontal field of view of the bounded scenes.
pub(super) const ORBIT_FOV_RAD: f64 = 40.0 * TAU / 360.0;

/// Distance of the cameras of the bounded scenes from the origin.
const ORBIT_RADIUS: f64 = 4.0;

/// The splits of a generated dataset.
pub(super) const SPLITS: [Split; 3] = [Split::Train, Split::Val, Split::Test];

/// How many views `options` want of a split.
pub(super) fn view_count(options: &SceneOptions, split: Split) -> usize {
    match split {
        Split::Train => options.views.train,
        Split::Val => options.views.val,
        Split::Test => options.views.test,
    }
}

/// The camera of view `index` of a split.
pub(super) fn camera(scene: &Scene, options: &SceneOptions, split: Split, index: usize) -> Camera {
    let mut random = SplitMix64::new(options.seed, split);
    let kind = options.lenses[index % options.lenses.len()];
    let (width, height) = options.size;
    let size = dvec2(f64::from(width), f64::from(height));
    let is_capture = scene.is_opaque();
    let world_from_camera = match is_capture {
        true => handheld(&mut random, index, view_count(options, split)),
        false => orbit(&mut random, index, orbit_radius(kind)),
    };
    // A capture's sensor is a little off, but a sphere is always whole.
    let is_exact = !is_capture || kind == LensKind::Equirectangular;
    let (stretch, middle) = if is_exact { (1.0, dvec2(0.5, 0.5)) } else { (1.004, dvec2(0.512, 0.489)) };
    Camera {
        width,
        height,
        focal_px: focal_px(size, is_capture, kind) * dvec2(1.0, stretch),
        center_px: middle * size,
        lens: lens(kind),
        world_from_camera,
    }
}

/// Lenses that see more are held closer.
fn orbit_radius(kind: LensKind) -> f64 {
    match kind {
        LensKind::Pinhole | LensKind::OpenCv | LensKind::Orthographic => ORBIT_RADIUS,
        LensKind::Fisheye => 0.5 * ORBIT_RADIUS,
        LensKind::Equirectangular => 0.4 * ORBIT_RADIUS,
    }
}

/// A fisheye sees 180 degrees along the diagonal of a square image, parallel rays about what a pinhole does.
fn focal_px(size: DVec2, is_capture: bool, kind: LensKind) -> DVec2 {
    let longer = size.max_element();
    match (kind, is_capture) {
        (LensKind::Pinhole | LensKind::OpenCv, true) => DVec2::splat(0.75 * longer),
        (LensKind::Pinhole | LensKind::OpenCv, false) => {
            DVec2::splat(0.5 * size.x / (0.5 * ORBIT_FOV_RAD).tan())
        }
        (LensKind::Fisheye, _) => DVec2::splat(longer / 2.2),
        (LensKind::Orthographic, true) => DVec2::splat(longer / 2.2),
        (LensKind::Orthographic, false) => DVec2::splat(longer / 2.6),
        (LensKind::Equirectangular, _) => size / dvec2(TAU, 0.5 * TAU),
    }
}

/// Lenses with a moderate distortion, invertible over the whole image.
fn lens(kind: LensKind) -> Lens {
    match kind {
        LensKind::Pinhole => Lens::Pinhole,
        LensKind::OpenCv => Lens::OpenCv { k: [-0.11, 0.02, 0.0, 0.0], p: [0.0012, -0.0008] },
        LensKind::Fisheye => Lens::Fisheye { k: [-0.02, 0.003, -0.0004, 0.0] },
        LensKind::Orthographic => Lens::Orthographic,
        LensKind::Equirectangular => Lens::Equirectangular,
    }
}

/// Evenly spread over the sphere without its poles, looking at the origin: the R2 sequence from a random start,
/// so that any run of consecutive views is spread too.
fn orbit(random: &mut SplitMix64, index: usize, radius: f64) -> DAffine3 {
    const PLASTIC: f64 = 1.324_717_957_244_746;
    let step = index as f64;
    let angle = TAU * (random.unit() + step / PLASTIC).fract();
    let lift = (random.unit() + step / (PLASTIC * PLASTIC)).fract();
    let up = -0.55 + 1.5 * lift;
    let flat = (1.0 - up * up).sqrt();
    look_at(radius * dvec3(flat * angle.cos(), flat * angle.sin(), up), DVec3::ZERO, 0.0)
}

/// A walk around the middle with a swaying hand: distance, height, aim and roll vary.
fn handheld(random: &mut SplitMix64, index: usize, count: usize) -> DAffine3 {
    let start = random.unit();
    random.skip(index);
    let mut sway = |size: f64| size * (2.0 * random.unit() - 1.0);
    let angle = TAU * (start + (index as f64 + 0.3 * sway(1.0)) / count as f64);
    let distance = 2.55 + sway(0.3);
    let height = 1.2 + 0.35 * (3.0 * angle).sin() + sway(0.25);
    let eye = dvec3(distance * angle.cos(), distance * angle.sin(), height);
    let aim = dvec3(sway(0.25), sway(0.25), 0.68 + sway(0.15));
    look_at(eye, aim, sway(0.05))
}

/// The pose at `eye` looking at `target`, rolled clockwise by `roll_rad`; z is up in the world.
fn look_at(eye: DVec3, target: DVec3, roll_rad: f64) -> DAffine3 {
    let back = (eye - target).normalize();
    let right = DVec3::Z.cross(back).normalize();
    let up = back.cross(right);
    let (sin, cos) = roll_rad.sin_cos();
    let axes = DMat3::from_cols(cos * right - sin * up, sin * right + cos * up, back);
    DAffine3::from_mat3_translation(axes, eye)
}

/// The SplitMix64 generator, one stream per seed and split.
struct SplitMix64 {
    state: u64,
}

impl SplitMix64 {
    const STEP: u64 = 0x9E37_79B9_7F4A_7C15;

    fn new(seed: u64, split: Split) -> Self {
        let mut random = Self { state: seed ^ (split as u64 + 1).rotate_left(61) };
        random.state = random.bits();
        random
    }

    /// Moves to the numbers of view `index`.
    fn skip(&mut self, index: usize) {
        self.state = self.state.wrapping_add(Self::STEP.wrapping_mul(16 * (index as u64 + 1)));
    }

    fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(Self::STEP);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Uniform in `[0, 1)`.
    fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::super::ViewCounts;
    use super::*;

    fn cameras(scene: &str, split: Split) -> Vec<Camera> {
        let options =
            SceneOptions { views: ViewCounts { train: 40, val: 5, test: 9 }, ..SceneOptions::new(scene) };
        let scene = Scene::named(scene).expect("a known scene");
        (0..view_count(&options, split)).map(|i| camera(&scene, &options, split, i)).collect()
    }

    #[test]
    fn poses_are_rotations() {
        for scene in ["toys", "courtyard"] {
            for camera in cameras(scene, Split::Train) {
                let axes = camera.world_from_camera.matrix3;
                assert!((axes.determinant() - 1.0).abs() < 1e-12);
                assert!((axes * axes.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-12));
            }
        }
    }

    #[test]
    fn orbits_look_at_the_origin_from_above_and_below() {
        let cameras = cameras("toys", Split::Train);
        for camera in &cameras {
            let pose = camera.world_from_camera;
            assert!((pose.translation.length() - ORBIT_RADIUS).abs() < 1e-12);
            assert!(pose.translation.normalize().abs_diff_eq(pose.matrix3.z_axis, 1e-12));
        }
        let heights = || cameras.iter().map(|camera| camera.world_from_camera.translation.z);
        assert!(heights().any(|z| z < -1.5) && heights().any(|z| z > 3.0));
    }

    #[test]
    fn splits_and_seeds_differ() {
        for scene in ["toys", "courtyard"] {
            let [train, val, test] = SPLITS.map(|split| cameras(scene, split));
            for camera in val.iter().chain(&test) {
                let eye = camera.world_from_camera.translation;
                let apart = |other: &Camera| other.world_from_camera.translation.distance(eye) > 1e-3;
                assert!(train.iter().all(apart));
            }
        }
        let eye = |seed| orbit(&mut SplitMix64::new(seed, Split::Train), 0, ORBIT_RADIUS).translation;
        assert!(eye(0).distance(eye(1)) > 1e-3);
    }
}
