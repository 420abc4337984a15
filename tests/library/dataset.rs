//! Datasets as they are found in the wild, and as they should not be.

use std::path::Path;

use crate::support::{folder, shared};
use nerf::camera::Lens;
use nerf::capture::dataset::{Dataset, HoldOut, OpenOptions, UsualView, read_cameras};
use nerf::capture::image_file::{ExrPixels, Precision, write_exr, write_png_rgba8};
use nerf::photo::AlphaMode;

fn open(path: &Path) -> Dataset {
    Dataset::open(path, &OpenOptions::default()).expect("a valid dataset")
}

pub(super) fn has_note(dataset: &Dataset, text: &str) -> bool {
    dataset.notes.iter().any(|note| note.message.contains(text))
}

#[test]
fn lego() {
    let Some(path) = shared("data/lego_100") else {
        return;
    };
    let lego = open(&path);
    assert_eq!((lego.train.len(), lego.val.len(), lego.test.len()), (100, 10, 25));
    assert_eq!((lego.listed, lego.missing.len(), lego.distinct_cameras()), (135, 0, 1));
    assert_eq!(lego.dialect, "blender");
    assert!(lego.is_cutout && !lego.is_hdr);
    assert_eq!(lego.reading.alpha, AlphaMode::Straight);
    let names: Vec<_> = lego.train[..3].iter().map(|&i| &lego.frames[i].name).collect();
    assert_eq!(names, ["./train/r_0", "./train/r_1", "./train/r_2"]);
    let camera = &lego.frames[0].camera;
    assert_eq!(camera.center_px.to_array(), [50.0, 50.0]);
    assert!((camera.focal_px.x - 138.888_9).abs() < 1e-3);
    assert!(lego.bounds.center.length() < 0.1, "{:?}", lego.bounds);
    assert!((lego.bounds.half - 1.47).abs() < 0.05 && lego.bounds.cascades == 1);
    let mut images = Vec::new();
    lego.stream(&lego.test, false, &mut |position, photo| {
        assert_eq!(position, images.len());
        assert!(photo.ignored.is_empty() && photo.depth.is_empty());
        images.push(photo.image);
        Ok(())
    })
    .expect("decodes");
    assert_eq!(images.len(), 25);
    assert_eq!(images[3], lego.load(lego.test[3], true).expect("decodes").image);
    assert!(images.iter().all(|image| image.width == 100 && image.has_alpha));
}

#[test]
fn fox() {
    let Some(path) = shared("data/fox_270x480") else {
        return;
    };
    let fox = open(&path);
    assert_eq!((fox.listed, fox.frames.len(), fox.missing.len()), (67, 50, 17));
    assert_eq!((fox.train.len(), fox.test.len()), (43, 7));
    assert!((0..50).step_by(8).eq(fox.test.iter().copied()));
    assert!(has_note(&fox, "17 of 67 listed images are missing"));
    let camera = &fox.frames[0].camera;
    assert_eq!(camera.center_px.to_array(), [138.6395, 241.317]);
    assert_eq!(camera.focal_px.to_array(), [343.88, 343.6225]);
    let expected = Lens::OpenCv { k: [0.0578421, -0.0805099, 0.0, 0.0], p: [-0.000980296, 0.00015575] };
    assert_eq!(camera.lens, expected);
    assert!((fox.bounds.half - 0.5 / 0.33).abs() < 1e-12 && fox.bounds.cascades == 3);
    let by_file = open(&path.join("transforms.json"));
    assert_eq!(by_file.test, fox.test);
    let options = OpenOptions { hold_out: HoldOut::None, ..OpenOptions::default() };
    let all = Dataset::open(&path, &options).expect("valid");
    assert_eq!((all.train.len(), all.test.len()), (50, 0));
}

#[test]
fn stitch() {
    let Some(path) = shared("data/stitch_200") else {
        return;
    };
    let stitch = open(&path);
    assert_eq!((stitch.train.len(), stitch.val.len(), stitch.test.len()), (88, 22, 22));
    assert_eq!(stitch.frames[0].camera.center_px.to_array(), [95.054, 108.61675]);
    assert_eq!(stitch.bounds.cascades, 5, "{:?}", stitch.notes);
    assert!(stitch.missing.is_empty());
}

#[test]
fn minimal_fixtures() {
    if let Some(path) = shared("data/brush_test_dataset") {
        let brush = open(&path);
        assert_eq!(brush.frames[0].camera.focal_px.to_array(), [50.0, 50.0]);
        assert_eq!((brush.train.len(), brush.test.len()), (1, 0));
        assert!(has_note(&brush, "field of view beside it"));
    }
    if let Some(path) = shared("data/nerfstudio_lego_test") {
        let lego = open(&path);
        assert_eq!((lego.train.len(), lego.val.len(), lego.test.len()), (1, 1, 1));
        assert!((lego.bounds.half - 1.45).abs() < 0.05, "{:?}", lego.bounds);
    }
}

/// A folder with `images/0.png` to `images/{count - 1}.png` of 8x6 pixels.
fn photos(count: usize) -> tempfile::TempDir {
    let folder = folder();
    std::fs::create_dir(folder.path().join("images")).expect("writable");
    for index in 0..count {
        let path = folder.path().join(format!("images/{index}.png"));
        write_png_rgba8(&path, 8, 6, &[[200, 100, 50, 255]; 48]).expect("writable");
    }
    folder
}

pub(super) const POSE: &str = "[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]";

fn frame(file_path: &str, matrix: &str, rest: &str) -> String {
    format!("{{\"file_path\": \"{file_path}\", \"transform_matrix\": {matrix}{rest}}}")
}

/// Opens a folder of two photos with this document as its transforms.json.
fn open_text(text: &[u8]) -> anyhow::Result<Dataset> {
    let folder = photos(2);
    std::fs::write(folder.path().join("transforms.json"), text).expect("writable");
    Dataset::open(folder.path(), &OpenOptions::default())
}

#[test]
fn mistakes_are_explained() {
    let document = |frame: &str, file: &str| format!("{{\"frames\": [{frame}]{file}}}");
    let angle = ", \"camera_angle_x\": 0.7";
    let cases = [
        ("{".to_owned(), "line 1 column 1"),
        (document("{}", angle), "frame 0: `file_path` is missing"),
        (document(&frame("images/9.png", POSE, ""), angle), "1 of 1 listed images are missing"),
        (document(&frame("transforms.json", POSE, ""), angle), "expected PNG, JPEG, WebP"),
    ];
    for (text, expected) in cases {
        let message = format!("{:#}", open_text(text.as_bytes()).expect_err(expected));
        assert!(message.contains(expected), "{expected:?} is not in {message:?}");
        assert!(
            message.contains("transforms.json") || message.contains("frame 0") || message.contains("missing")
        );
    }
    let message = format!("{:#}", open_text(b"\xe9{}").expect_err("not UTF-8"));
    assert!(message.contains("transforms.json") && message.contains("UTF-8"), "{message}");
    let nowhere = Dataset::open(Path::new("no/such/folder"), &OpenOptions::default());
    assert!(format!("{:#}", nowhere.expect_err("missing")).contains("does not exist"));
    let empty = photos(0);
    std::fs::write(empty.path().join("poses.json"), "{}").expect("writable");
    let message = Dataset::open(empty.path(), &OpenOptions::default()).expect_err("no json");
    assert!(format!("{message:#}").contains("found poses.json; name the file itself"));
}

#[test]
fn unreadable_photos_are_one_message_for_each_kind() {
    let folder = photos(40);
    let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n";
    for index in 0..40 {
        let content = if index % 10 == 9 { "" } else { pointer };
        std::fs::write(folder.path().join(format!("images/{index}.png")), content).expect("writable");
    }
    let frames: Vec<_> = (0..40).map(|index| frame(&format!("images/{index}.png"), POSE, "")).collect();
    let text = format!("{{\"camera_angle_x\": 0.7, \"frames\": [{}]}}", frames.join(","));
    std::fs::write(folder.path().join("transforms.json"), text).expect("writable");
    let options = OpenOptions { allow_missing: true, ..OpenOptions::default() };
    let damaged = Dataset::open(folder.path(), &options).expect("looked at").damaged;
    let lfs = "36 of 40 photos cannot be read (images/0.png, images/1.png, images/2.png, …): each is a Git LFS pointer in \
               place of the picture; run `git lfs pull` in the dataset's folder";
    assert_eq!((damaged.len(), damaged[0].as_str()), (2, lfs));
    assert!(damaged[1].contains("4 of 40 photos") && damaged[1].contains("an empty file"), "{}", damaged[1]);
    let message = Dataset::open(folder.path(), &OpenOptions::default()).expect_err("refused").to_string();
    assert_eq!(message, damaged.join("; "));
}

#[test]
fn oddities_are_tolerated() {
    let frames = [
        frame(
            "C:\\\\data\\\\images\\\\1.png",
            POSE,
            ", \"w\": 16.0, \"h\": 12.0, \"fl_x\": 20, \"cx\": 9, \"cy\": 6",
        ),
        frame("./images/0", POSE, ""),
        frame("images/0.png", POSE, ""),
    ];
    let text =
        format!("\u{feff}{{ // by hand\n\"camera_angle_x\": 0.7, \"frames\": [{}]}}", frames.join(","));
    let dataset = open_text(text.as_bytes()).expect("tolerated");
    assert_eq!(dataset.frames.len(), 2);
    assert!(has_note(&dataset, "more than once") && has_note(&dataset, "end of the path"));
    assert!(has_note(&dataset, "belong to 16x12 pixels, the image has 8x6"));
    let scaled = dataset.frames.iter().find(|frame| frame.name.starts_with("C:/"));
    let camera = &scaled.expect("kept").camera;
    assert_eq!(camera.focal_px.to_array(), [10.0, 10.0]);
    assert_eq!(camera.center_px.to_array(), [4.5, 3.0]);
    assert!(!dataset.is_cutout, "an opaque alpha channel cuts nothing out");
}

#[test]
fn dynamic_ranges_do_not_mix() {
    let folder = photos(1);
    let color = [[3.5, 1.0, 0.0, 0.5]; 48];
    let pixels = ExrPixels { color: &color, depth: None };
    let path = folder.path().join("images/1.exr");
    write_exr(&path, 8, 6, &pixels, Precision::Half).expect("writable");
    let write = |names: &[&str]| {
        let frames: Vec<_> = names.iter().map(|name| frame(name, POSE, "")).collect();
        let text = format!("{{\"x_fov\": 40, \"frames\": [{}]}}", frames.join(","));
        std::fs::write(folder.path().join("transforms.json"), text).expect("writable");
        Dataset::open(folder.path(), &OpenOptions::default())
    };
    let hdr = write(&["images/1"]).expect("valid");
    assert!(hdr.is_hdr && hdr.is_cutout);
    let mixed = write(&["images/0", "images/1"]).expect_err("mixed");
    assert!(format!("{mixed:#}").contains("expected all images in a linear format"));
}

#[test]
fn cameras_are_read_without_images() {
    let folder = folder();
    let path = folder.path().join("path.json");
    let frames = [frame("b", POSE, ", \"w\": 64, \"h\": 48"), frame("a", POSE, "")];
    let text = format!("{{\"camera_angle_x\": 0.7, \"frames\": [{}]}}", frames.join(","));
    std::fs::write(&path, text).expect("writable");
    let cameras = read_cameras(&path, UsualView { size: [320, 240], focal_px: 300.0 }).expect("valid");
    let sizes: Vec<_> = cameras.iter().map(|(name, c)| (name.as_str(), c.width)).collect();
    assert_eq!(sizes, [("b", 64), ("a", 320)]);
}
