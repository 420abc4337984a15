//! The generated datasets against what geometry says about them.

use crate::support::folder;
use glam::{DMat3, DVec3, dvec3};
use nerf::camera::{Camera, Lens, LensKind, Ray};
use nerf::capture::dataset::{Dataset, OpenOptions};
use nerf::verify::scene::{Hit, Scene, SceneOptions, ViewCounts, generate, names};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

const VIEWS: ViewCounts = ViewCounts { train: 3, val: 1, test: 2 };

fn small(scene: &str) -> SceneOptions {
    SceneOptions { views: VIEWS, size: (40, 30), ..SceneOptions::new(scene) }
}

fn listing(folder: &Path, split: &str) -> Value {
    let path = folder.join(format!("transforms_{split}.json"));
    let text = fs::read_to_string(path).expect("a listing per split");
    serde_json::from_str(&text).expect("JSON")
}

/// All files below `folder` by relative path.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for split in ["", "train", "val", "test"] {
        for entry in fs::read_dir(folder.join(split)).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_file() {
                let name = path.strip_prefix(folder).expect("inside").to_string_lossy().into_owned();
                found.insert(name, fs::read(&path).expect("readable"));
            }
        }
    }
    found
}

/// The planes of an EXR file by channel name.
fn planes(path: &Path) -> BTreeMap<String, Vec<f32>> {
    let image = exr::prelude::read_first_flat_layer_from_file(path).expect("EXR");
    let channels = image.layer_data.channel_data.list;
    let plane = |c: &exr::prelude::AnyChannel<exr::prelude::FlatSamples>| {
        (c.name.to_string(), c.sample_data.values_as_f32().collect())
    };
    channels.iter().map(plane).collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// The axes and the position of a frame's camera.
fn pose(frame: &Value) -> (DMat3, DVec3) {
    let entry = |row: usize, column: usize| number(&frame["transform_matrix"][row][column]);
    let column = |c: usize| dvec3(entry(0, c), entry(1, c), entry(2, c));
    (DMat3::from_cols(column(0), column(1), column(2)), column(3))
}

#[test]
fn same_options_give_the_same_bytes() {
    for info in names() {
        let folders = [(); 2].map(|()| folder());
        for folder in &folders {
            generate(&small(info.name), folder.path(), &|_| ()).expect("generated");
        }
        let [a, b] = folders.each_ref().map(|folder| contents(folder.path()));
        assert_eq!(a.len(), 2 * VIEWS.total() + 3);
        assert!(a == b, "{} differs between runs", info.name);
        let other = folder();
        generate(&SceneOptions { seed: 1, ..small(info.name) }, other.path(), &|_| ()).expect("generated");
        assert!(contents(other.path()) != a, "{} ignores the seed", info.name);
    }
}

#[test]
fn depth_is_positive_exactly_where_alpha_is() {
    for (scene, hdr) in [("toys", true), ("courtyard", false), ("fog", true)] {
        let folder = folder();
        generate(&SceneOptions { hdr, ..small(scene) }, folder.path(), &|_| ()).expect("generated");
        for frame in listing(folder.path(), "train")["frames"].as_array().expect("frames") {
            let depth_path = frame["depth_file_path"].as_str().expect("a depth file");
            let planes = planes(&folder.path().join(depth_path));
            for (&alpha, &z) in planes["A"].iter().zip(&planes["Z"]) {
                assert!((0.0..=1.0).contains(&alpha) && z.is_finite() && (alpha > 0.0) == (z > 0.0));
                assert!(scene != "courtyard" || alpha > 0.999_999);
            }
            assert!(planes["A"].iter().any(|&alpha| alpha > 0.5));
        }
    }
}

#[test]
fn png_alpha_is_the_depth_file_s_alpha() {
    let folder = folder();
    generate(&small("toys"), folder.path(), &|_| ()).expect("generated");
    let planes = planes(&folder.path().join("train/0000_depth.exr"));
    let png = image::open(folder.path().join("train/0000.png")).expect("PNG").into_rgba8();
    for (pixel, &alpha) in png.pixels().zip(&planes["A"]) {
        assert!((f32::from(pixel[3]) - 255.0 * alpha).abs() <= 0.5001);
    }
}

#[test]
fn cameras_look_at_the_scene() {
    for info in names() {
        let folder = folder();
        generate(&small(info.name), folder.path(), &|_| ()).expect("generated");
        for split in ["train", "val", "test"] {
            for frame in listing(folder.path(), split)["frames"].as_array().expect("frames") {
                let (axes, eye) = pose(frame);
                assert!((axes * axes.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-12));
                assert!(axes.determinant() > 0.0);
                // The middle of the scene lies ahead and within ten degrees of the axis.
                let middle = if info.name == "courtyard" { dvec3(0.0, 0.0, 0.7) } else { DVec3::ZERO };
                assert!((middle - eye).normalize().dot(-axes.z_axis) > 0.98, "{}", info.name);
                assert!(axes.y_axis.z > 0.0, "upright");
            }
        }
    }
}

/// The silhouette of a ball of radius R at distance D from a pinhole looking at its centre is a circle of
/// radius `f R / sqrt(D² - R²)` pixels.
#[test]
fn fog_silhouette_and_depth_are_exact() {
    let folder = folder();
    let options = SceneOptions { size: (100, 100), hdr: true, samples: 6, ..small("fog") };
    generate(&options, folder.path(), &|_| ()).expect("generated");
    let planes = planes(&folder.path().join("test/0000_depth.exr"));
    let focal = 50.0 / 20.0_f64.to_radians().tan();
    let (near, distance, density) = (3.0, 4.0_f64, 1.5_f64);

    // Sum of alpha = ∫ (1 - exp(-σ chord)) over the circle, by a fine midpoint rule over its radius.
    let edge = focal / (distance * distance - 1.0).sqrt();
    let steps = 100_000;
    let rings = (0..steps).map(|i| {
        let pixels = edge * (f64::from(i) + 0.5) / f64::from(steps);
        let slope = pixels / focal;
        let passing = distance * distance * slope * slope / (1.0 + slope * slope);
        let chord = 2.0 * (1.0 - passing).max(0.0).sqrt();
        -(-density * chord).exp_m1() * std::f64::consts::TAU * pixels * edge / f64::from(steps)
    });
    let want: f64 = rings.sum();
    let got: f64 = planes["A"].iter().map(|&alpha| f64::from(alpha)).sum();
    assert!((got / want - 1.0).abs() < 1e-4, "{got} {want}");

    // The mean depth along the diameter: near + 1/σ - 2 e^{-2σ} / (1 - e^{-2σ}).
    let tau = 2.0 * density;
    let center = near + 1.0 / density - 2.0 * (-tau).exp() / -(-tau).exp_m1();
    let got = f64::from(planes["Z"][50 * 100 + 50]);
    assert!((got - center).abs() < 1e-3, "{got} {center}");
}

/// The ball on the tripod of `toys` has radius 0.12 about (0, 0, 0.72).
#[test]
fn toys_depth_of_a_known_ball() {
    let scene = Scene::named("toys").expect("a known scene");
    let eye = dvec3(2.0, -3.0, 1.5);
    let center = dvec3(0.0, 0.0, 0.72);
    let hit = scene.trace(eye, center - eye);
    assert!((hit.t - ((center - eye).length() - 0.12)).abs() < 1e-12);
    assert_eq!(scene.trace(eye, eye - center), Hit::MISS);
}

#[test]
fn all_of_toys_is_within_its_radius() {
    let scene = Scene::named("toys").expect("a known scene");
    for i in 0..20_000_u32 {
        // Tangent rays of the ball of radius 1.2, and beyond it.
        let z = 1.0 - (f64::from(i) + 0.5) / 10_000.0;
        let (sin, cos) = (2.399_963 * f64::from(i)).sin_cos();
        let out = dvec3(cos * (1.0 - z * z).sqrt(), sin * (1.0 - z * z).sqrt(), z);
        let along = out.any_orthonormal_vector();
        assert_eq!(scene.trace(1.2 * out - 4.0 * along, along), Hit::MISS);
    }
}

#[test]
fn captures_carry_their_intrinsics() {
    let folder = folder();
    let options = SceneOptions { lenses: vec![LensKind::OpenCv], ..small("courtyard") };
    generate(&options, folder.path(), &|_| ()).expect("generated");
    let listing = listing(folder.path(), "test");
    assert_eq!(listing["camera_model"], "OPENCV");
    assert_eq!((&listing["w"], &listing["h"]), (&40.into(), &30.into()));
    assert_eq!(listing["frames"][0]["file_path"], "./test/0000.png");
    let keys = ["fl_x", "fl_y", "cx", "cy", "k1", "k2", "p1", "p2"].map(|key| number(&listing[key]));
    assert!(keys.iter().all(|&value| value != 0.0));

    // The camera read back from the file sees what the file shows.
    let (axes, eye) = pose(&listing["frames"][0]);
    let [fx, fy, cx, cy, k1, k2, p1, p2] = keys;
    let camera = Camera {
        width: 40,
        height: 30,
        focal_px: glam::dvec2(fx, fy),
        center_px: glam::dvec2(cx, cy),
        lens: Lens::OpenCv { k: [k1, k2, 0.0, 0.0], p: [p1, p2] },
        world_from_camera: glam::DAffine3::from_mat3_translation(axes, eye),
    };
    let depth = &planes(&folder.path().join("test/0000_depth.exr"))["Z"];
    let scene = Scene::named("courtyard").expect("a known scene");
    let agreeing = (0..depth.len()).filter(|&i| {
        let pixel = glam::dvec2((i % 40) as f64 + 0.5, (i / 40) as f64 + 0.5);
        let Some(Ray { origin, direction }) = camera.ray(pixel) else { return false };
        let z = scene.trace(origin, direction).t * direction.dot(-axes.z_axis);
        (z - f64::from(depth[i])).abs() < 0.03 * z
    });
    let share = agreeing.count() as f64 / depth.len() as f64;
    assert!(share > 0.75, "only {share} of the pixels away from edges agree");
}

/// Every frame's camera, read back from the files, sees what the files show.
#[test]
fn every_lens_is_written_and_read_back() {
    let kinds = LensKind::ALL.into_iter().map(|kind| vec![kind]).chain([LensKind::ALL.to_vec()]);
    for (lenses, name) in kinds.flat_map(|lenses| [(lenses.clone(), "courtyard"), (lenses, "toys")]) {
        let folder = folder();
        let views = ViewCounts { train: 5, val: 1, test: 1 };
        let options =
            SceneOptions { lenses: lenses.clone(), views, size: (48, 24), ..SceneOptions::new(name) };
        generate(&options, folder.path(), &|_| ()).expect("generated");
        let dataset = Dataset::open(folder.path(), &OpenOptions::default()).expect("a dataset");
        let scene = Scene::named(name).expect("a known scene");
        for (number, &index) in dataset.train.iter().enumerate() {
            let camera = &dataset.frames[index].camera;
            assert_eq!(camera.lens.kind(), lenses[number % lenses.len()], "{name} {lenses:?}");
            let depth = &planes(&folder.path().join(format!("train/{number:04}_depth.exr")))["Z"];
            let agrees = |i: usize| {
                let pixel = glam::dvec2((i % 48) as f64 + 0.5, (i / 48) as f64 + 0.5);
                let Some(Ray { origin, direction }) = camera.ray(pixel) else { return depth[i] == 0.0 };
                let hit = scene.trace(origin, direction);
                if hit.alpha == 0.0 {
                    return depth[i] == 0.0;
                }
                let seen = camera.project(origin + hit.t * direction).map_or(f64::NAN, |(_, depth)| depth);
                (seen - f64::from(depth[i])).abs() < 0.03 * seen
            };
            let share = (0..depth.len()).filter(|&i| agrees(i)).count() as f64 / depth.len() as f64;
            assert!(share > 0.7, "{name} {lenses:?} frame {number}: only {share} of the pixels agree");
        }
    }
}

#[test]
fn bounded_scenes_are_written_as_blender_does() {
    let folder = folder();
    let options = small("toys");
    let summary = generate(&options, folder.path(), &|_| ()).expect("generated");
    assert_eq!((summary.scene, summary.views, summary.files), ("toys", 6, 15));
    let listing = listing(folder.path(), "train");
    assert!((number(&listing["camera_angle_x"]).to_degrees() - 40.0).abs() < 1e-12);
    assert_eq!(listing["frames"][2]["file_path"], "./train/0002");
    assert!(folder.path().join("train/0002.png").is_file());
}

#[test]
fn hdr_exceeds_one() {
    let folder = folder();
    let options = SceneOptions { hdr: true, size: (100, 100), ..small("toys") };
    generate(&options, folder.path(), &|_| ()).expect("generated");
    let brightest = (0..3)
        .flat_map(|i| planes(&folder.path().join(format!("train/000{i}.exr")))["R"].clone())
        .fold(0.0, f32::max);
    assert!(brightest > 1.2, "{brightest}");
}

#[test]
fn mistakes_are_explained() {
    let folder = folder();
    let fails = |options: &SceneOptions, out: &Path| {
        format!("{:#}", generate(options, out, &|_| ()).expect_err("a mistake"))
    };
    let fresh = folder.path().join("new");
    assert!(fails(&small("toy"), &fresh).contains("toys, courtyard, fog"));
    assert!(fails(&SceneOptions { lenses: vec![], ..small("toys") }, &fresh).contains("at least one"));
    assert!(fails(&SceneOptions { size: (0, 9), ..small("toys") }, &fresh).contains("0x9"));
    assert!(!fresh.exists(), "nothing is created before the options are checked");
    fs::write(folder.path().join("notes.txt"), "mine").expect("written");
    assert!(fails(&small("toys"), folder.path()).contains("not empty"));
    assert!(fails(&small("toys"), &folder.path().join("notes.txt")).contains("notes.txt"));
    assert!(ViewCounts::of_total(2).is_err());
    assert_eq!(ViewCounts::of_total(100).expect("enough"), ViewCounts { train: 82, val: 6, test: 12 });
}

#[test]
fn nothing_stays_of_what_was_interrupted() {
    let place = tempfile::tempdir().expect("temporary folder");
    let (options, out) = (small("toys"), place.path().join("toys"));
    let stop = |_: usize| options.interrupt.raise();
    let error = generate(&options, &out, &stop).expect_err("interrupted after the first view");
    assert!(nerf::support::interrupt::Interrupted::is_cause_of(&error), "{error:#}");
    assert!(!out.exists(), "the next attempt finds no folder in use");
}
