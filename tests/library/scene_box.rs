//! The scene box of captures whose optical axes do not tell where the scene is: a guess, or what files tell.

use crate::support::folder;
use nerf::capture::dataset::{Dataset, OpenOptions};
use nerf::capture::health::Survey;
use nerf::capture::image_file::write_png_rgba8;
use serde_json::{Value, json};
use std::f64::consts::TAU;
use std::fmt::Write;
use std::fs;
use tempfile::TempDir;

const VIEWS: usize = 24;
/// Of the circle that the cameras stand on.
const RADIUS: f64 = 0.25;
/// Half the sides of the room.
const ROOM: [f64; 3] = [3.0, 2.5, 1.4];

/// A capture of a room, outwards from a small circle in its middle; z points up.
struct Pan {
    folder: TempDir,
    file: Value,
}

impl Pan {
    fn new() -> Self {
        let frame = |index: usize| {
            let (s, c) = (TAU * index as f64 / VIEWS as f64).sin_cos();
            // Right, up and back.
            let pose = [
                [s, 0.0, -c, RADIUS * c],
                [-c, 0.0, -s, RADIUS * s],
                [0.0, 1.0, 0.0, 0.0],
                [0.0, 0.0, 0.0, 1.0],
            ];
            json!({"file_path": format!("{index:02}.png"), "transform_matrix": pose})
        };
        let frames: Vec<_> = (0..VIEWS).map(frame).collect();
        let file = json!({"w": 16, "h": 12, "fl_x": 12, "fl_y": 12, "cx": 8, "cy": 6, "frames": frames});
        Self { folder: folder(), file }
    }

    fn open(&self) -> Dataset {
        let path = self.folder.path();
        fs::write(path.join("transforms.json"), self.file.to_string()).expect("written");
        let options = OpenOptions { allow_missing: true, ..OpenOptions::default() };
        Dataset::open(path, &options).expect("a valid dataset")
    }

    /// Adds a point cloud of the walls, shifted.
    fn add_cloud(&mut self, shift: f64) {
        let mut text = "ply\nformat ascii 1.0\nelement vertex 600\n".to_owned();
        ["x", "y", "z"].iter().for_each(|axis| writeln!(text, "property float {axis}").expect("text"));
        text += "end_header\n";
        for index in 0..600 {
            let (s, c) = (TAU * f64::from(index) / 600.0).sin_cos();
            let out = f64::min(ROOM[0] / c.abs(), ROOM[1] / s.abs());
            let height = 1.4 * (f64::from(index % 21) / 10.0 - 1.0);
            writeln!(text, "{} {} {height}", out * c + shift, out * s).expect("text");
        }
        fs::write(self.folder.path().join("sparse_pc.ply"), text).expect("written");
        self.file["ply_file_path"] = json!("sparse_pc.ply");
    }
}

fn says(dataset: &Dataset, text: &str) -> bool {
    Survey::of(dataset).findings.iter().any(|finding| finding.message.contains(text))
}

#[test]
fn a_room_of_any_size_is_held_by_a_box_that_is_a_guess() {
    let pan = Pan::new().open();
    assert!(pan.bounds.is_guess && says(&pan, "the scene box is a guess"), "{:?}", pan.bounds);
    assert!(pan.bounds.outer_half() >= 60.0 * RADIUS && pan.bounds.cascades <= 8, "{:?}", pan.bounds);
    assert!(pan.bounds.half < 3.0 * RADIUS, "{:?}", pan.bounds);
    let mut stated = Pan::new();
    stated.file["aabb"] = json!([[-3.1, -2.6, -1.5], [3.1, 2.6, 1.5]]);
    let stated = stated.open();
    assert!(!stated.bounds.is_guess && !says(&stated, "guess"), "{:?}", stated.bounds);
    assert!((stated.bounds.outer_half() - 3.1).abs() < 1e-9);
}

#[test]
fn a_point_cloud_tells_the_box() {
    let mut pan = Pan::new();
    pan.add_cloud(0.0);
    let dataset = pan.open();
    let bounds = &dataset.bounds;
    assert!(
        !bounds.is_guess && bounds.source.contains("sparse_pc.ply") && !says(&dataset, "guess"),
        "{bounds:?}"
    );
    assert!(bounds.center.length() < 0.1 && (2.9..3.5).contains(&bounds.half), "{bounds:?}");
    assert!(bounds.outer_half() >= 3.0 && bounds.cascades == 2, "{bounds:?}");
    // One in other coordinates, a damaged and a missing one are not used, which is said.
    pan.add_cloud(500.0);
    let elsewhere = pan.open();
    assert!(elsewhere.bounds.is_guess);
    assert!(elsewhere.notes.iter().any(|note| note.message.contains("in other coordinates")));
    fs::write(pan.folder.path().join("sparse_pc.ply"), "ply\nformat ascii 1.0\nelement vertex 9")
        .expect("written");
    assert!(pan.open().notes.iter().any(|note| note.message.contains("the point cloud is not used")));
    fs::remove_file(pan.folder.path().join("sparse_pc.ply")).expect("removed");
    let missing = pan.open();
    assert!(missing.bounds.is_guess && missing.notes.iter().any(|note| note.message.contains("is missing")));
}

#[test]
fn depth_tells_the_box() {
    let mut pan = Pan::new();
    for (index, frame) in pan.file["frames"].as_array_mut().expect("a list").iter_mut().enumerate() {
        let grey = [[90, 90, 90, 255]; 16 * 12];
        write_png_rgba8(&pan.folder.path().join(format!("{index:02}.png")), 16, 12, &grey).expect("written");
        // Millimetres, to a wall 2.75 m away; 0 is unknown.
        let depth =
            image::ImageBuffer::from_fn(16, 12, |x, _| image::Luma([if x == 0 { 0 } else { 2750u16 }]));
        depth.save(pan.folder.path().join(format!("depth{index:02}.png"))).expect("written");
        frame["depth_file_path"] = json!(format!("depth{index:02}.png"));
    }
    let bounds = pan.open().bounds;
    assert!(!bounds.is_guess && bounds.source.contains("depth"), "{bounds:?}");
    assert!(bounds.center.length() < 0.3 && (3.0..3.8).contains(&bounds.half), "{bounds:?}");
}
