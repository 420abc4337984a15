//! Alpha beside the image, straight and premultiplied.

use glam::DVec2;
use image::{ImageBuffer, ImageFormat, Rgba};
use nerf::capture::image_file::{ExrPixels, Precision, write_exr, write_png_rgba8};
use nerf::photo::Pixels;
use nerf::photo::{AlphaMode, Reading};

use super::{COUNT, Folder, HEIGHT, WIDTH, has_note, srgb8};

#[test]
fn alpha_beside_the_image_is_alpha() {
    for name in ["images/0.png.alpha.png", "images/0.alpha.png"] {
        let folder = Folder::new();
        folder.grey(name, [WIDTH, HEIGHT], |x, _| if x == 0 { 51 } else { 255 });
        let dataset = folder.one("", &Reading::default());
        assert!(dataset.frames[0].has_alpha && dataset.is_cutout && !dataset.frames[0].has_mask, "{name}");
        let photo = dataset.load(0, false).expect("readable");
        assert_eq!(srgb8(&photo)[0], [0, 0, 200, 51], "straight");
        assert_eq!(srgb8(&photo)[1], [1, 2, 200, 255]);
    }
}

/// Disks with soft edges, straight or multiplied with alpha.
fn soft_disks(folder: &Folder, name: &str, color: [f64; 3], is_multiplied: bool) {
    let pixel = |x: u32, y: u32| {
        let distance = DVec2::new(f64::from(x) - 31.5, f64::from(y) - 31.5).length();
        let alpha = ((20.0 - distance) / 8.0 + 0.5).clamp(0.0, 1.0);
        let scale = if is_multiplied { alpha } else { 1.0 };
        let [r, g, b] = color.map(|value| (value * scale * 255.0).round() as u8);
        if alpha == 0.0 { Rgba([0; 4]) } else { Rgba([r, g, b, (alpha * 255.0).round() as u8]) }
    };
    let picture = ImageBuffer::from_fn(64, 64, pixel);
    picture.save_with_format(folder.path(name), ImageFormat::Png).expect("writable");
}

#[test]
fn premultiplied_colours_are_told_by_their_edges() {
    let bright = [0.9, 0.8, 0.1];
    let open = |color, is_multiplied, alpha| {
        let folder = Folder::new();
        soft_disks(&folder, "images/0.png", color, is_multiplied);
        let dataset = folder.one("", &Reading { alpha, ..Reading::default() });
        let photo = dataset.load(0, false).expect("readable");
        let edge = srgb8(&photo).iter().find(|pixel| (100..150).contains(&pixel[3])).copied();
        (dataset, edge.expect("a soft edge"))
    };
    let auto = AlphaMode::Auto;
    let (straight, edge) = open(bright, false, auto);
    assert_eq!((straight.reading.alpha, edge[0]), (AlphaMode::Straight, 230));
    assert!(!has_note(&straight, "premultiplied"));
    let (multiplied, edge) = open(bright, true, auto);
    assert_eq!(multiplied.reading.alpha, AlphaMode::Premultiplied);
    assert!(edge[0].abs_diff(230) <= 1 && edge[2].abs_diff(26) <= 1, "divided: {edge:?}");
    assert!(has_note(&multiplied, "taken for premultiplied"));
    // Dark colours are below their alpha either way, and nothing can be told.
    assert_eq!(open([0.02; 3], false, auto).0.reading.alpha, AlphaMode::Straight);
    assert_eq!(open([0.02; 3], true, auto).0.reading.alpha, AlphaMode::Straight);
    // Asking is stronger.
    let (_, edge) = open(bright, true, AlphaMode::Straight);
    assert!(edge[0] < 150);
    assert_eq!(open(bright, false, AlphaMode::Premultiplied).1[0], 255);
}

#[test]
fn alpha_without_edges_is_straight() {
    let usual = Reading::default();
    let folder = Folder::new();
    write_png_rgba8(&folder.path("images/0.png"), WIDTH, HEIGHT, &[[9, 8, 7, 0]; COUNT]).expect("writable");
    let clear = folder.one("", &usual);
    assert_eq!((clear.reading.alpha, clear.is_cutout), (AlphaMode::Straight, true));
    write_png_rgba8(&folder.path("images/0.png"), WIDTH, HEIGHT, &[[9, 8, 7, 99]; COUNT]).expect("writable");
    assert_eq!(folder.one("", &usual).reading.alpha, AlphaMode::Straight);
    let opaque = Folder::new().one("", &usual);
    assert_eq!((opaque.reading.alpha, opaque.is_cutout), (AlphaMode::Straight, false));
}

#[test]
fn linear_alpha_is_premultiplied_unless_told_otherwise() {
    let folder = Folder::new();
    let color = [[0.5, 4.0, 0.0, 0.25]; COUNT];
    let path = folder.path("images/2.exr");
    let view = ExrPixels { color: &color, depth: None };
    write_exr(&path, WIDTH, HEIGHT, &view, Precision::Float).expect("writable");
    let first = |alpha| {
        let reading = Reading { alpha, ..Reading::default() };
        let dataset = folder.try_open(&["\"file_path\": \"images/2\""], "", &reading).expect("valid");
        let Pixels::Linear(pixels) = dataset.load(0, false).expect("readable").image.pixels else {
            panic!("linear")
        };
        (dataset.reading.alpha, pixels[0])
    };
    assert_eq!(first(AlphaMode::Auto), (AlphaMode::Premultiplied, color[0]));
    assert_eq!(first(AlphaMode::Straight), (AlphaMode::Straight, [0.125, 1.0, 0.0, 0.25]));
}
