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
    let steps = ImageBuffer::from_fn(WIDTH, HEIGHT, |x, _| Luma([100 * x as u16]));
    DynamicImage::ImageLuma16(steps).save(folder.path("depth/0.png")).expect("writable");
    let listed = ", \"depth_file_path\": \"depth/0.png\"";
    let (dataset, millimetres) = depth_of(&folder, listed, "");
    assert!(dataset.frames[0].has_depth);
    assert_eq!(millimetres[..4], [0.0, 0.1, 0.2, 0.3]);
    for (file, step) in [
        (", \"depth_unit_scale_factor\": 0.01", 1.0),
        (", \"depth_scaling_factor\": 400.0", 0.25),
        (", \"integer_depth_scale\": 0.02", 2.0),
    ] {
        assert_eq!(depth_of(&folder, listed, file).1[3], 3.0 * step, "{file}");
    }
    let ngp = ", \"depth_path\": \"depth/0\"";
    assert_eq!(depth_of(&folder, ngp, ", \"integer_depth_scale\": 0.02").1[2], 4.0);
    let (dataset, none) = depth_of(&folder, ngp, "");
    assert!(none.is_empty() && !dataset.frames[0].has_depth && has_note(&dataset, "integer_depth_scale"));
    let (dataset, none) = depth_of(&folder, ", \"depth_file_path\": \"nowhere.png\"", "");
    assert!(none.is_empty() && has_note(&dataset, "its depth file is missing"));
}

#[test]
fn what_stands_for_far_away_is_unknown() {
    let folder = Folder::new();
    let saturated = ImageBuffer::from_fn(WIDTH, HEIGHT, |x, _| Luma([[2500, 65535][usize::from(x > 2)]]));
    DynamicImage::ImageLuma16(saturated).save(folder.path("depth/0.png")).expect("writable");
    let listed = ", \"depth_file_path\": \"depth/0.png\"";
    let (dataset, depth) = depth_of(&folder, listed, "");
    assert_eq!(depth[..4], [2.5, 2.5, 2.5, 0.0]);
    assert_eq!(dataset.load(0, true).expect("readable").far_depth, 0.75);
    assert_eq!(dataset.load(0, false).expect("readable").far_depth, 0.0);
    let sky: Vec<f32> = (0..96).map(|i| [2.5, 1e10][usize::from(i % 12 > 2)]).collect();
    let view = ExrPixels { color: &[[0.0; 4]; 96], depth: Some(&sky) };
    write_exr(&folder.path("sky.exr"), WIDTH, HEIGHT, &view, Precision::Float).expect("writable");
    let listed = ", \"depth_file_path\": \"sky.exr\"";
    let (dataset, depth) = depth_of(&folder, listed, "");
    assert_eq!(depth[..4], [2.5, 2.5, 2.5, 0.0]);
    assert_eq!(dataset.load(0, true).expect("readable").far_depth, 0.75);
    // Floats have the factor that is for all numbers.
    assert_eq!(depth_of(&folder, listed, ", \"depth_unit_scale_factor\": 0.5").1[0], 1.25);
    assert_eq!(depth_of(&folder, listed, ", \"integer_depth_scale\": 0.5").1[0], 2.5);
}

#[test]
fn depth_of_another_aspect_is_refused() {
    let folder = Folder::new();
    let turned = ImageBuffer::from_pixel(HEIGHT, WIDTH, Luma([1000_u16]));
    DynamicImage::ImageLuma16(turned).save(folder.path("0.png")).expect("writable");
    let frame = "\"file_path\": \"images/0.png\", \"depth_file_path\": \"0.png\"";
    let dataset = folder.try_open(&[frame], "", &Reading::default()).expect("valid");
    let message = format!("{:#}", dataset.load(0, true).expect_err("refused"));
    assert!(message.contains("0.png: expected the aspect of its photo, 12x8, found 8x12"), "{message}");
    dataset.load(0, false).expect("it is not looked at");
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
