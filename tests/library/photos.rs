//! Photos as training gets them: masks, alpha, depth, orientation, crops and sizes.

mod alpha;
mod depth;

use std::path::{Path, PathBuf};

use super::dataset::{POSE, has_note};
use crate::support::folder;
use glam::DVec2;
use image::codecs::jpeg::JpegEncoder;
use image::metadata::Orientation;
use image::{DynamicImage, GrayImage, ImageBuffer, ImageEncoder, ImageFormat, Luma, Rgb};
use nerf::capture::dataset::{Dataset, HoldOut, OpenOptions};
use nerf::capture::image_file::write_png_rgba8;
use nerf::photo::{BitDepth, Pixels};
use nerf::photo::{Crop, Photo, Reading};

const WIDTH: u32 = 12;
const HEIGHT: u32 = 8;
const COUNT: usize = (WIDTH * HEIGHT) as usize;

/// A dataset being put together.
struct Folder(tempfile::TempDir);

impl Folder {
    /// With `images/0.png` and `images/1.png`, opaque.
    fn new() -> Self {
        let folder = Self(folder());
        for name in ["images/0.png", "images/1.png"] {
            write_png_rgba8(&folder.path(name), WIDTH, HEIGHT, &pixels()).expect("writable");
        }
        folder
    }

    /// The path of a file in it, whose folder is made.
    fn path(&self, name: &str) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::create_dir_all(path.parent().expect("below the root")).expect("writable");
        path
    }

    /// A grey image whose pixels `value` gives by column and row.
    fn grey(&self, name: &str, size: [u32; 2], value: impl Fn(u32, u32) -> u8) {
        let picture = GrayImage::from_fn(size[0], size[1], |x, y| Luma([value(x, y)]));
        picture.save_with_format(self.path(name), ImageFormat::Png).expect("writable");
    }

    fn try_open(&self, frames: &[&str], file: &str, reading: &Reading) -> anyhow::Result<Dataset> {
        let frame = |rest: &&str| format!("{{\"transform_matrix\": {POSE}, {rest}}}");
        let frames: Vec<_> = frames.iter().map(frame).collect();
        let text = format!("{{\"camera_angle_x\": 0.7, \"frames\": [{}]{file}}}", frames.join(","));
        std::fs::write(self.path("transforms.json"), text).expect("writable");
        let hold_out = HoldOut::None;
        Dataset::open(
            self.0.path(),
            &OpenOptions { hold_out, reading: reading.clone(), ..OpenOptions::default() },
        )
    }

    /// Opens it with `images/0.png` as its only frame, which has these further keys.
    fn one(&self, keys: &str, reading: &Reading) -> Dataset {
        let frame = format!("\"file_path\": \"images/0.png\"{keys}");
        self.try_open(&[&frame], "", reading).expect("a valid dataset")
    }
}

fn pixels() -> Vec<[u8; 4]> {
    (0..COUNT).map(|i| [i as u8, 2 * i as u8, 200, 255]).collect()
}

fn srgb8(photo: &Photo) -> &[[u8; 4]] {
    let Pixels::Srgb8(pixels) = &photo.image.pixels else { panic!("8 bits") };
    pixels
}

/// Columns of the first row that are ignored.
fn ignored(dataset: &Dataset) -> Vec<usize> {
    let photo = dataset.load(0, false).expect("readable");
    (0..dataset.frames[0].camera.width as usize).filter(|&x| photo.ignored.get(x) == Some(&true)).collect()
}

#[test]
fn masks_of_every_convention_are_found_and_add_up() {
    let usual = Reading::default();
    let folder = Folder::new();
    let none = folder.one("", &usual);
    assert!(!none.frames[0].has_mask && ignored(&none).is_empty());
    // nerfstudio: black is ignored; zeros and ones will do.
    folder.grey("other/mask.png", [WIDTH, HEIGHT], |x, _| u8::from(x != 3));
    let listed = folder.one(", \"mask_path\": \"other/mask.png\"", &usual);
    assert!(listed.frames[0].has_mask);
    assert_eq!(ignored(&listed), [3]);
    let inverted = Reading { invert_masks: true, ..Reading::default() };
    assert_eq!(ignored(&folder.one(", \"mask_path\": \"other/mask.png\"", &inverted)).len(), 11);
    // instant-ngp: everything but black is ignored.
    folder.grey("images/dynamic_mask_0.png", [WIDTH, HEIGHT], |x, _| if x == 5 { 9 } else { 0 });
    assert_eq!(ignored(&folder.one("", &usual)), [5]);
    assert_eq!(ignored(&folder.one(", \"mask_path\": \"other/mask\"", &usual)), [3, 5]);
    // Folders: black is ignored.
    for name in ["masks/0.png", "masks/0.png.png", "masks/images/0.png", "masks/0.jpg"] {
        let folder = Folder::new();
        folder.grey(name, [WIDTH, HEIGHT], |x, _| if x == 7 { 0 } else { 255 });
        assert_eq!(ignored(&folder.one("", &usual)), [7], "{name}");
    }
    let folder = Folder::new();
    std::fs::copy(folder.path("images/0.png"), folder.path("a/images/b/0.png")).expect("writable");
    folder.grey("a/masks/b/0.png", [WIDTH, HEIGHT], |x, _| if x == 8 { 0 } else { 255 });
    let nested = folder.try_open(&["\"file_path\": \"a/images/b/0.png\""], "", &usual).expect("valid");
    assert_eq!(ignored(&nested), [8]);
}

#[test]
fn masks_that_do_not_fit_or_are_missing() {
    let usual = Reading::default();
    let folder = Folder::new();
    folder.grey("mask.png", [WIDTH / 2, HEIGHT / 2], |x, _| if x == 1 { 0 } else { 255 });
    let small = folder.one(", \"mask_path\": \"mask.png\"", &usual);
    assert_eq!(ignored(&small), [2, 3]);
    assert!(has_note(&small, "its mask has another size"));
    let missing = folder.one(", \"mask_path\": \"nowhere.png\"", &usual);
    assert!(!missing.frames[0].has_mask && has_note(&missing, "`mask_path` names is missing"));
    folder.grey("black.png", [WIDTH, HEIGHT], |_, _| 0);
    let black = folder.one(", \"mask_path\": \"black.png\"", &usual).load(0, false).expect("readable");
    assert!(black.is_ignored() && black.count_ignored() == COUNT);
    let some =
        ["\"file_path\": \"images/0.png\", \"mask_path\": \"mask.png\"", "\"file_path\": \"images/1.png\""];
    let some = folder.try_open(&some, "", &usual).expect("valid");
    assert!(has_note(&some, "1 of 2 frames have no mask"));
    std::fs::write(folder.path("mask.png"), "torn").expect("writable");
    let torn = folder.try_open(&["\"file_path\": \"images/0\", \"mask_path\": \"mask.png\""], "", &usual);
    let message = format!("{:#}", torn.expect_err("not an image"));
    assert!(message.contains("frame 0") && message.contains("mask.png"), "{message}");
}

#[test]
fn eight_and_sixteen_bits_mix() {
    let folder = Folder::new();
    let deep = ImageBuffer::from_pixel(WIDTH, HEIGHT, Rgb([1_u16, 2, 60000]));
    DynamicImage::ImageRgb16(deep).save(folder.path("images/1.png")).expect("writable");
    let frames = ["\"file_path\": \"images/0.png\"", "\"file_path\": \"images/1.png\""];
    let dataset = folder.try_open(&frames, "", &Reading::default()).expect("valid");
    assert_eq!((dataset.bit_depth, dataset.is_hdr), (BitDepth::Sixteen, false));
    assert_eq!((dataset.frames[0].bits, dataset.frames[1].bits), (BitDepth::Eight, BitDepth::Sixteen));
    assert!(has_note(&dataset, "some images have 8 bits and some 16"));
    let Pixels::Srgb16(wide) = dataset.load(0, false).expect("readable").image.pixels else {
        panic!("16 bits")
    };
    assert_eq!(wide[1], [257, 514, 51400, 65535]);
    let Pixels::Srgb16(deep) = dataset.load(1, false).expect("readable").image.pixels else {
        panic!("16 bits")
    };
    assert_eq!(deep[0], [1, 2, 60000, 65535]);
}

/// A JPEG whose left third is red, with an orientation in its metadata.
fn turned_jpeg(path: &Path, orientation: Orientation) {
    let color = |x, _| if x < 16 { Rgb([255_u8, 0, 0]) } else { Rgb([0, 0, 255]) };
    let picture = ImageBuffer::from_fn(48, 32, color);
    let file = std::fs::File::create(path).expect("writable");
    let mut encoder = JpegEncoder::new_with_quality(file, 95);
    let header = *b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0";
    let exif = [&header[..], &[orientation.to_exif(), 0, 0, 0, 0, 0, 0]].concat();
    encoder.set_exif_metadata(exif).expect("JPEG has metadata");
    encoder.encode_image(&picture).expect("writable");
}

#[test]
fn orientation_follows_the_declared_size() {
    let folder = Folder::new();
    turned_jpeg(&folder.path("images/2.jpg"), Orientation::Rotate90);
    folder.grey("masks/2.png", [48, 32], |x, _| if x < 16 { 0 } else { 255 });
    let open = |file: &str| {
        let frames = ["\"file_path\": \"images/2.jpg\""];
        folder.try_open(&frames, file, &Reading::default()).expect("valid")
    };
    for stored in ["", ", \"w\": 48, \"h\": 32", ", \"w\": 96, \"h\": 64"] {
        let dataset = open(stored);
        assert_eq!((dataset.frames[0].camera.width, dataset.frames[0].camera.height), (48, 32), "{stored}");
        assert!(has_note(&dataset, "its pixels are used as they are stored"), "{:?}", dataset.notes);
        let photo = dataset.load(0, false).expect("readable");
        assert!(srgb8(&photo)[5][0] > 200 && photo.ignored[5] && !photo.ignored[40], "{stored}");
    }
    for turned in [", \"w\": 32, \"h\": 48", ", \"w\": 320, \"h\": 480"] {
        let dataset = open(turned);
        assert_eq!((dataset.frames[0].camera.width, dataset.frames[0].camera.height), (32, 48));
        assert!(has_note(&dataset, "it is turned"), "{:?}", dataset.notes);
        let photo = dataset.load(0, false).expect("readable");
        // What was left is on top.
        let (top, bottom) = (srgb8(&photo)[5], srgb8(&photo)[47 * 32 + 5]);
        assert!(top[0] > 200 && bottom[2] > 200, "{top:?} {bottom:?}");
        assert!(photo.ignored[5] && !photo.ignored[47 * 32 + 5]);
    }
}

#[test]
fn crops_and_sizes_keep_cameras_and_sidecars_in_step() {
    let folder = Folder::new();
    folder.grey("masks/0.png", [WIDTH, HEIGHT], |x, y| if (x, y) == (5, 4) { 0 } else { 255 });
    let crop = Crop { left: 2, top: 1, right: 4, bottom: 1 };
    let reading = Reading { downscale: 2, crop, ..Reading::default() };
    let (whole, part) = (folder.one("", &Reading::default()), folder.one("", &reading));
    let (whole_camera, camera) = (&whole.frames[0].camera, &part.frames[0].camera);
    assert_eq!((camera.width, camera.height), (3, 3));
    assert_eq!(camera.center_px.to_array(), [2.0, 1.5]);
    // The same ray, through the same place.
    let ray = camera.ray(DVec2::new(1.5, 2.0)).expect("pinhole");
    let same = whole_camera.ray(DVec2::new(2.0 + 3.0, 1.0 + 4.0)).expect("pinhole");
    assert!(ray.direction.distance(same.direction) < 1e-14);
    let photo = part.load(0, false).expect("readable");
    assert_eq!(photo.image.size(), [3, 3]);
    // The mean of columns 2, 3 and rows 1, 2: 14, 15, 26, 27, and twice as much in green.
    assert_eq!(srgb8(&photo)[0], [21, 41, 200, 255]);
    let ignored: Vec<_> = (0..9).filter(|&i| photo.ignored[i]).collect();
    assert_eq!(ignored, [3 + 1]);
    let nothing = Reading { crop: Crop { left: 6, right: 6, ..Crop::default() }, ..Reading::default() };
    let refused = folder.try_open(&["\"file_path\": \"images/0.png\""], "", &nothing);
    let message = format!("{:#}", refused.expect_err("nothing left"));
    assert!(message.contains("frame 0") && message.contains("leaves nothing of 12x8"), "{message}");
}

#[test]
fn fewer_images_are_evenly_spaced() {
    let folder = Folder::new();
    let names: Vec<_> = (0..10).map(|i| format!("images/{i}.png")).collect();
    for name in &names {
        write_png_rgba8(&folder.path(name), WIDTH, HEIGHT, &pixels()).expect("writable");
    }
    let frames: Vec<_> = names.iter().map(|name| format!("\"file_path\": \"{name}\"")).collect();
    let frames: Vec<_> = frames.iter().map(String::as_str).collect();
    let open = |most| {
        let reading = Reading { max_images: Some(most), ..Reading::default() };
        folder.try_open(&frames, "", &reading).expect("valid")
    };
    let few = open(4);
    assert_eq!(few.train, [0, 2, 5, 7]);
    assert!(has_note(&few, "4 of 10 frames are trained on"));
    assert_eq!(open(10).train.len(), 10);
    assert_eq!(open(99).train.len(), 10);
}

#[test]
fn frames_stream_in_order_and_stop_at_the_first_failure() {
    let folder = Folder::new();
    let names: Vec<_> = (0..30).map(|i| format!("\"file_path\": \"images/{i}.png\"")).collect();
    for index in 0..30 {
        let path = folder.path(&format!("images/{index}.png"));
        write_png_rgba8(&path, WIDTH, HEIGHT, &[[index, 0, 0, 255]; COUNT]).expect("writable");
    }
    let frames: Vec<_> = names.iter().map(String::as_str).collect();
    let dataset = folder.try_open(&frames, "", &Reading::default()).expect("valid");
    let backwards: Vec<_> = (0..30).rev().collect();
    let mut seen = Vec::new();
    let mut take = |position: usize, photo: Photo| {
        assert_eq!(seen.len(), position);
        seen.push(usize::from(srgb8(&photo)[0][0]));
        Ok(())
    };
    dataset.stream(&backwards, false, &mut take).expect("readable");
    assert_eq!(seen, backwards);
    let bytes = dataset.stream_bytes(&backwards, false);
    let photo = COUNT as u64 * 4;
    assert!((photo..photo * 30 * 4).contains(&bytes), "{bytes}");
    assert_eq!(dataset.stream_bytes(&[], false), 0);
    std::fs::write(folder.path("images/7.png"), "gone bad").expect("writable");
    let mut count = 0;
    let failed = dataset.stream(&(0..30).collect::<Vec<_>>(), false, &mut |_, _| {
        count += 1;
        Ok(())
    });
    assert!(format!("{:#}", failed.expect_err("damaged")).contains("7.png"));
    assert_eq!(count, 7);
    write_png_rgba8(&folder.path("images/7.png"), 1, 1, &[[0; 4]]).expect("writable");
    let message = format!("{:#}", dataset.load(7, false).expect_err("another size"));
    assert!(message.contains("had 12x8 pixels when the dataset was opened and has 1x1 now"), "{message}");
}
