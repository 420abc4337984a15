//! Depth files of every unit and size.

use image::{DynamicImage, ImageBuffer, Luma};
use nerf::capture::dataset::Dataset;
use nerf::capture::image_file::{ExrPixels, Precision, write_exr};
use nerf::photo::Reading;

use super::{Folder, HEIGHT, WIDTH, has_note};

/// Depth of `images/0.png` from its file.
fn depth_of(folder: &Folder, keys: &str, file: &str) -> (Dataset, Vec<f32>) {
    let frame = format!("\"file_path\": \"images/0.png\"{keys}");
    let dataset = folder.try_open(&[&frame], file, &Reading::default()).expect("valid");
    let depth = dataset.load(0, true).expect("readable").depth;
    assert!(dataset.load(0, false).expect("readable").depth.is_empty(), "not asked for");
    (dataset, depth)
}

#[test]
fn depth_is_in_world_units() {
    let folder = Folder::new();
    let steps = ImageBuffer::from_fn(WIDTH, HEIGHT, |x, _| Luma([1000 * x as u16]));
    DynamicImage::ImageLuma16(steps).save(folder.path("depth/0.png")).expect("writable");
    let listed = ", \"depth_file_path\": \"depth/0.png\"";
    let (dataset, millimetres) = depth_of(&folder, listed, "");
    assert!(dataset.frames[0].has_depth);
    assert_eq!(millimetres[..4], [0.0, 1.0, 2.0, 3.0]);
    for (file, step) in [
        (", \"depth_unit_scale_factor\": 0.01", 10.0),
        (", \"depth_scaling_factor\": 500.0", 2.0),
        (", \"integer_depth_scale\": 0.5", 500.0),
    ] {
        assert_eq!(depth_of(&folder, listed, file).1[3], 3.0 * step, "{file}");
    }
    let ngp = ", \"depth_path\": \"depth/0\"";
    assert_eq!(depth_of(&folder, ngp, ", \"integer_depth_scale\": 0.5").1[2], 1000.0);
    let (dataset, none) = depth_of(&folder, ngp, "");
    assert!(none.is_empty() && !dataset.frames[0].has_depth && has_note(&dataset, "integer_depth_scale"));
    let (dataset, none) = depth_of(&folder, ", \"depth_file_path\": \"nowhere.png\"", "");
    assert!(none.is_empty() && has_note(&dataset, "its depth file is missing"));
}

#[test]
fn depth_of_floats_and_other_sizes() {
    let folder = Folder::new();
    let depth: Vec<f32> = (0..6).map(|i| [2.5, -1.0, f32::NAN, f32::INFINITY, 0.0, 7.0][i]).collect();
    let view = ExrPixels { color: &[[0.0; 4]; 6], depth: Some(&depth) };
    write_exr(&folder.path("depth.exr"), 3, 2, &view, Precision::Float).expect("writable");
    for key in ["depth_file_path", "depth_path"] {
        let (_, depth) = depth_of(&folder, &format!(", \"{key}\": \"depth.exr\""), "");
        let rows: Vec<_> = depth.chunks(WIDTH as usize).map(|row| [row[0], row[4], row[11]]).collect();
        assert_eq!(rows[0], [2.5, 0.0, 0.0]);
        assert_eq!(rows[3], rows[0]);
        assert_eq!(rows[7], [0.0, 0.0, 7.0]);
    }
}
