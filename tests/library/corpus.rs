//! Files as they are found on the web, against what a plain walk over their keys finds.

use crate::support::{files, shared};
use nerf::camera::LensKind::{self, OpenCv, Pinhole};
use nerf::camera::{Camera, Lens};
use nerf::capture::dataset::{Dataset, OpenOptions, transforms};
use serde_json::Value;

/// One file: the number that its name starts with, what is said about it as a whole, and its first frame.
struct Expected {
    number: &'static str,
    dialect: &'static str,
    frames: usize,
    /// At the declared size, or of 800x800 pixels.
    focal_x: f64,
    lens: LensKind,
    /// Parts of the notes, in their order; no other note may be there.
    notes: &'static [&'static str],
}

const fn file(
    number: &'static str,
    dialect: &'static str,
    frames: usize,
    focal_x: f64,
    lens: LensKind,
) -> Expected {
    Expected { number, dialect, frames, focal_x, lens, notes: &[] }
}

const TABLE: &[Expected] = &[
    file("001", "blender", 1, 1111.111031, Pinhole),
    file("003", "instant-ngp", 110, 838.670000, OpenCv),
    file("005", "instant-ngp", 16, 755.251000, OpenCv),
    file("007", "blender", 100, 1111.111031, Pinhole),
    file("009", "instant-ngp", 134, 986.466467, OpenCv),
    file("011", "instant-ngp", 492, 594.773874, OpenCv),
    file("013", "instant-ngp", 111, 569.102119, OpenCv),
    file("015", "instant-ngp", 35, 1361.962985, OpenCv),
    file("017", "blender", 1, 1111.111031, Pinhole),
    file("019", "instant-ngp", 150, 2049.470000, OpenCv),
    file("021", "instant-ngp", 186, 2078.680095, OpenCv),
    file("023", "blender", 75, 1111.111392, Pinhole),
    file("025", "instant-ngp", 50, 1375.520000, OpenCv),
    file("027", "instant-ngp", 69, 3185.093351, OpenCv),
    file("029", "blender", 200, 1293.091258, Pinhole),
    file("031", "blender", 1, 910.453125, Pinhole),
    file("033", "blender", 200, 1111.111031, Pinhole),
    file("035", "instant-ngp", 199, 1678.046637, OpenCv),
    file("037", "per-frame intrinsics", 4, 290.016144, Pinhole),
    file("039", "blender", 90, 1039.942428, Pinhole),
    file("041", "blender", 100, 1111.111031, Pinhole),
    Expected {
        notes: &["read as right, up, forward"],
        ..file("043", "instant-ngp", 21, 1811.649124, OpenCv)
    },
    file("045", "instant-ngp", 13, 1027.787953, OpenCv),
    file("047", "nerfstudio", 100, 166503.906250, Pinhole),
    file("049", "instant-ngp", 15, 834.313719, OpenCv),
    file("051", "instant-ngp", 93, 1005.542079, Pinhole),
    Expected {
        notes: &[
            "frame 0 './train/render_0000.png' and 49 more: `fl_y` is 1866.67 pixels but `camera_angle_y`",
        ],
        ..file("053", "instant-ngp", 50, 1866.666641, Pinhole)
    },
    file("057", "blender", 20, 1111.111031, Pinhole),
    file("059", "blender", 100, 1250.000050, Pinhole),
    file("061", "blender", 200, 1250.000050, Pinhole),
    file("063", "blender", 8, 1111.304918, Pinhole),
    file("067", "nerfstudio", 20, 343.359550, Pinhole),
    file("073", "instant-ngp", 110, 798.387356, OpenCv),
    file("075", "instant-ngp", 36, 1607.462216, OpenCv),
    Expected {
        notes: &["`seg_file_path` is not heeded"],
        ..file("077", "nerfstudio", 81, 584.108807, Pinhole)
    },
    file("079", "instant-ngp", 29, 3359.669721, OpenCv),
    file("081", "instant-ngp", 46, 1364.391066, OpenCv),
    file("083", "blender", 100, 11683.657779, Pinhole),
    file("085", "blender", 10, 548.993772, Pinhole),
    file("087", "blender", 32, 1111.111031, Pinhole),
    file("089", "instant-ngp", 3, 553.740000, Pinhole),
    file("091", "instant-ngp", 81, 627.789292, OpenCv),
    file("093", "instant-ngp", 2, 2388.379758, OpenCv),
    file("095", "instant-ngp", 3, 3429.304516, OpenCv),
    file("097", "instant-ngp", 37, 1469.581563, OpenCv),
    file("099", "instant-ngp", 37, 1470.309707, OpenCv),
    file("101", "instant-ngp", 26, 1483.284792, OpenCv),
    file("103", "instant-ngp", 70, 4641.169922, Pinhole),
    file("105", "instant-ngp", 20, 1714.101248, OpenCv),
];

/// The size that cameras are asked for where the file has none.
const SIZE: f64 = 800.0;

/// The objects that may say something about a frame, most specific first.
fn layers<'a>(frame: &'a Value, file: &'a Value) -> Vec<&'a Value> {
    [Some(frame), frame.get("intrinsics"), Some(file)].into_iter().flatten().collect()
}

fn first(layers: &[&Value], key: &str) -> Option<f64> {
    layers.iter().find_map(|layer| layer[key].as_f64())
}

/// Focal length and principal point in pixels of the declared size.
fn pixels(layers: &[&Value], size: [f64; 2]) -> [f64; 4] {
    if let Some(k) = layers.iter().find_map(|layer| layer.get("K")) {
        let at = |row: usize, column: usize| k[row][column].as_f64().expect("a number");
        return [at(0, 0), at(1, 1), at(0, 2), at(1, 2)];
    }
    let focal = |keys: [&str; 2]| keys.iter().find_map(|key| first(layers, key));
    let from_angle = || {
        let angle = first(layers, "camera_angle_x").expect("an angle");
        0.5 * size[0] / (0.5 * angle).tan()
    };
    let fx = focal(["fl_x", "fx"]).unwrap_or_else(from_angle);
    let fy = focal(["fl_y", "fy"]).unwrap_or(fx);
    let cx = first(layers, "cx").unwrap_or(0.5 * size[0]);
    let cy = first(layers, "cy").unwrap_or(0.5 * size[1]);
    [fx, fy, cx, cy]
}

/// k1 k2 k3 k4 p1 p2.
fn distortion(layers: &[&Value]) -> [f64; 6] {
    let keys = ["k1", "k2", "k3", "k4", "p1", "p2"];
    let layer = layers.iter().find(|layer| keys.iter().any(|key| layer.get(key).is_some()));
    keys.map(|key| layer.and_then(|layer| layer[key].as_f64()).unwrap_or(0.0))
}

fn assert_close(what: &str, got: &[f64], expected: &[f64], tolerance: f64) {
    for (got, expected) in got.iter().zip(expected) {
        assert!((got - expected).abs() <= tolerance * expected.abs().max(1.0), "{what}: {got} {expected}");
    }
}

fn check_frame(
    name: &str,
    entry: &nerf::capture::dataset::FrameEntry,
    frame: &Value,
    file: &Value,
    third: f64,
) {
    let layers = layers(frame, file);
    let declared = first(&layers, "w").zip(first(&layers, "h"));
    let doubled =
        first(&layers, "cx").zip(first(&layers, "cy")).map(|(x, y)| ((2.0 * x).round(), (2.0 * y).round()));
    let size = declared.or(doubled).map_or([SIZE; 2], <[f64; 2]>::from);
    let camera_at = |scale: f64| {
        let size = size.map(|side| (scale * side).round() as u32);
        entry.intrinsics.camera(size, entry.world_from_camera).0
    };
    let expected = pixels(&layers, size);
    let all =
        |camera: &Camera| [camera.focal_px.x, camera.focal_px.y, camera.center_px.x, camera.center_px.y];
    assert_close(name, &all(&camera_at(1.0)), &expected, 1e-9);
    if declared.is_some() || !layers.iter().any(|layer| layer.get("cx").is_some()) {
        assert_close(name, &all(&camera_at(2.0)), &expected.map(|length| 2.0 * length), 5e-3);
    }
    let found = match camera_at(1.0).lens {
        Lens::Pinhole => [0.0; 6],
        Lens::OpenCv { k: [k1, k2, k3, k4], p: [p1, p2] } => [k1, k2, k3, k4, p1, p2],
        other => panic!("{name}: {other:?}"),
    };
    assert_eq!(found, distortion(&layers), "{name}");
    let pose = entry.world_from_camera;
    for row in 0..3 {
        let expected = [0, 1, 2, 3].map(|column| {
            let sign = if column == 2 { third } else { 1.0 };
            sign * frame["transform_matrix"][row][column].as_f64().expect("a number")
        });
        let found = [pose.matrix3.x_axis, pose.matrix3.y_axis, pose.matrix3.z_axis].map(|axis| axis[row]);
        // One tool rounds to three decimals.
        assert_close(name, &found, &expected[..3], 1e-3);
        assert_close(name, &[pose.translation[row]], &expected[3..], 1e-12);
    }
    let product = pose.matrix3.transpose() * pose.matrix3;
    assert!(product.abs_diff_eq(glam::DMat3::IDENTITY, 1e-12), "{name}");
    assert!(pose.matrix3.determinant() > 0.0, "{name}");
}

#[test]
fn every_frame_of_the_corpus_is_read_as_written() {
    let Some(folder) = shared("transforms-corpus") else {
        return;
    };
    let files = files(&folder, "json");
    assert_eq!(files.len(), TABLE.len());
    for (path, expected) in files.iter().zip(TABLE) {
        let name = path.file_name().expect("a file").to_string_lossy();
        assert!(name.starts_with(expected.number), "{name}");
        let bytes = std::fs::read(path).expect("readable");
        let listing = transforms::parse_bytes(&bytes).unwrap_or_else(|error| panic!("{name}: {error:#}"));
        let plain: Value = serde_json::from_slice(&bytes).expect("JSON");
        let frames = plain["frames"].as_array().expect("a list");
        assert_eq!((listing.dialect, listing.frames.len()), (expected.dialect, expected.frames), "{name}");
        assert_eq!(frames.len(), expected.frames, "{name}");
        let notes: Vec<String> = listing.notes().iter().map(ToString::to_string).collect();
        assert_eq!(notes.len(), expected.notes.len(), "{name}: {notes:#?}");
        for (note, part) in notes.iter().zip(expected.notes) {
            assert!(note.contains(part), "{name}: {note}");
        }
        // The third columns of one file point forward.
        let third = if expected.number == "043" { -1.0 } else { 1.0 };
        for (index, (entry, frame)) in listing.frames.iter().zip(frames).enumerate() {
            check_frame(&format!("{name} {index}"), entry, frame, &plain, third);
        }
        let entry = &listing.frames[0];
        let size = entry.intrinsics.likely_size().map_or([SIZE; 2], |size| size.to_array());
        let size = size.map(|side| side.round() as u32);
        let camera = entry.intrinsics.camera(size, entry.world_from_camera).0;
        assert_eq!(camera.lens.kind(), expected.lens, "{name}");
        assert!((camera.focal_px.x - expected.focal_x).abs() < 1e-5, "{name}: {}", camera.focal_px.x);
    }
}

#[test]
fn every_file_of_the_corpus_opens_without_its_images() {
    let Some(folder) = shared("transforms-corpus") else {
        return;
    };
    for entry in std::fs::read_dir(folder).expect("readable") {
        let path = entry.expect("readable").path();
        let options = OpenOptions { allow_missing: true, ..OpenOptions::default() };
        let dataset = Dataset::open(&path, &options).unwrap_or_else(|error| panic!("{error:#}"));
        let bounds = &dataset.bounds;
        assert!(bounds.center.is_finite() && bounds.half > 0.0 && bounds.half.is_finite());
    }
}
