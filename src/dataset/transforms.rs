//! The `transforms.json` family: what one file lists, before any image is looked for.

use anyhow::{Context, Result, bail, ensure};
use glam::{DAffine3, DVec3};
use serde_json::Value;

use super::Split;
use super::intrinsics::{self, Intrinsics};
use super::json::{self, Fields, describe};
use super::notes::Notes;
use super::pose;
use super::sidecars::{self, DepthEntry};

/// One parsed file.
#[derive(Debug)]
pub struct Listing {
    /// The frames in the order of the file.
    pub frames: Vec<Entry>,
    /// The scene box of instant-ngp's keys, if the file has one of them.
    pub scene_box: Option<SceneBox>,
    /// Which family of tools writes such files.
    pub dialect: &'static str,
    pub(super) notes: Notes,
}

/// One frame as listed.
#[derive(Clone, Debug)]
pub struct Entry {
    /// `frame 3 'images/0004.png'`, for messages; counts from 0.
    pub label: String,
    /// The image, as the file spells it, with forward slashes.
    pub file_path: String,
    /// Focal length, principal point and lens.
    pub intrinsics: Intrinsics,
    /// Camera-to-world pose.
    pub world_from_camera: DAffine3,
    /// The split that the file's own lists put the frame in.
    pub split: Option<Split>,
    /// Its mask as the file spells it, with forward slashes; black pixels of it are ignored.
    pub mask_path: Option<String>,
    /// Its depth file.
    pub depth: Option<DepthEntry>,
}

/// A scene box in instant-ngp's terms: `world * scale + offset` maps the inner cube to `[0, 1]³`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneBox {
    /// Unit-cube lengths per world unit.
    pub scale: f64,
    /// Where the world's origin lies in the unit cube.
    pub offset: DVec3,
    /// Side of the whole box in inner cubes: a power of two, 1 to 128.
    pub aabb_scale: u32,
}

/// Parses the text of one file. Errors name the frame and the key.
pub fn parse(text: &str) -> Result<Listing> {
    let document = json::parse(text)?;
    let file = Fields(&document);
    let frames = file.list("frames")?.with_context(|| {
        let keys: Vec<_> = document.keys().take(8).map(String::as_str).collect();
        format!("expected a transforms.json with a list `frames`, found the keys {}", keys.join(", "))
    })?;
    ensure!(!frames.is_empty(), "`frames` is empty; expected at least one frame");
    let mut notes = Notes::default();
    let scene_box = scene_box(file, &mut notes)?;
    let lists = SplitLists::read(file)?;
    let mut entries = Vec::with_capacity(frames.len());
    for (index, frame) in frames.iter().enumerate() {
        let label = label(index, frame);
        let entry = entry(frame, file, &lists, &label, &mut notes);
        entries.push(entry.with_context(|| label.clone())?);
    }
    if lists.any() && entries.iter().all(|entry| entry.split.is_none()) {
        bail!("none of the frames is named in `train_filenames`, `val_filenames`, `test_filenames`");
    }
    Ok(Listing { frames: entries, scene_box, dialect: dialect(file), notes })
}

fn label(index: usize, frame: &Value) -> String {
    match frame.get("file_path").and_then(Value::as_str) {
        Some(path) => format!("frame {index} '{path}'"),
        None => format!("frame {index}"),
    }
}

fn entry(frame: &Value, file: Fields, lists: &SplitLists, label: &str, notes: &mut Notes) -> Result<Entry> {
    let Value::Object(map) = frame else {
        bail!("expected an object, found {}", describe(frame));
    };
    let fields = Fields(map);
    let file_path = fields
        .text("file_path")?
        .context("`file_path` is missing; every frame needs the name of its image")?
        .replace('\\', "/");
    ensure!(!file_path.trim().is_empty(), "`file_path` is empty");
    let mut layers = vec![fields];
    if let Some(Value::Object(nested)) = fields.get("intrinsics") {
        layers.push(Fields(nested));
    }
    layers.push(file);
    let (mask_path, depth) = sidecars::listed(fields, file)?;
    Ok(Entry {
        label: label.to_owned(),
        intrinsics: intrinsics::read(&layers, label, notes)?,
        world_from_camera: pose::read(fields, label, notes)?,
        split: lists.split_of(&file_path),
        file_path,
        mask_path,
        depth,
    })
}

/// Lists of file names per split, in the file itself.
struct SplitLists([Vec<String>; 3]);

impl SplitLists {
    const KEYS: [(Split, &'static str); 3] =
        [(Split::Train, "train_filenames"), (Split::Val, "val_filenames"), (Split::Test, "test_filenames")];

    fn read(file: Fields) -> Result<Self> {
        let mut lists = Self(Default::default());
        for (list, (_, key)) in lists.0.iter_mut().zip(Self::KEYS) {
            for name in file.list(key)?.unwrap_or_default() {
                let Value::String(name) = name else {
                    bail!("`{key}` must list file names, found {}", describe(name));
                };
                list.push(normal(name).to_owned());
            }
        }
        Ok(lists)
    }

    fn any(&self) -> bool {
        self.0.iter().any(|list| !list.is_empty())
    }

    fn split_of(&self, file_path: &str) -> Option<Split> {
        let lists = self.0.iter().zip(Self::KEYS);
        let mut holding = lists.filter(|(list, _)| list.iter().any(|n| n == normal(file_path)));
        holding.next_back().map(|(_, (split, _))| split)
    }
}

fn normal(file_path: &str) -> &str {
    file_path.strip_prefix("./").unwrap_or(file_path)
}

fn scene_box(file: Fields, notes: &mut Notes) -> Result<Option<SceneBox>> {
    if !file.has(&["aabb_scale", "scale", "offset", "aabb"]) {
        return Ok(None);
    }
    let asked = file.positive("aabb_scale", f64::INFINITY)?.unwrap_or(1.0);
    let aabb_scale = (asked.ceil().clamp(1.0, 128.0) as u32).next_power_of_two();
    if f64::from(aabb_scale) != asked {
        notes.note(format!("`aabb_scale` is {asked}; {aabb_scale} is used, a power of two from 1 to 128"));
    }
    // An explicit box is meant in world units and replaces scale and offset.
    if let Some(corners) = file.numbers("aabb")? {
        let [x0, y0, z0, x1, y1, z1] = corners[..] else {
            bail!("`aabb` must be [[x, y, z], [x, y, z]], found {} numbers", corners.len());
        };
        let (a, b) = (DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1));
        let side = (b - a).abs().max_element();
        ensure!(side > 0.0, "`aabb` has no extent: both corners are {a}");
        return Ok(Some(SceneBox {
            scale: side.recip(),
            offset: DVec3::splat(0.5) - 0.5 * (a + b) / side,
            aabb_scale,
        }));
    }
    let offset = match file.get("offset") {
        Some(Value::Array(_)) => match file.numbers("offset")?.as_deref() {
            Some(&[x, y, z]) => DVec3::new(x, y, z),
            _ => bail!("`offset` must be one number or three"),
        },
        _ => DVec3::splat(file.number("offset")?.unwrap_or(0.5)),
    };
    Ok(Some(SceneBox { scale: file.positive("scale", f64::INFINITY)?.unwrap_or(0.33), offset, aabb_scale }))
}

fn dialect(file: Fields) -> &'static str {
    const NERFSTUDIO: [&str; 6] = [
        "camera_model",
        "applied_transform",
        "ply_file_path",
        "orientation_override",
        "train_filenames",
        "test_filenames",
    ];
    const NGP: [&str; 5] = ["aabb_scale", "aabb", "offset", "fl_x", "k1"];
    if file.has(&NERFSTUDIO) {
        "nerfstudio"
    } else if file.has(&NGP) {
        "instant-ngp"
    } else if file.has(&["camera_angle_x", "camera_angle_y"]) {
        "blender"
    } else {
        "per-frame intrinsics"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POSE: &str = "[[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]";

    fn one(frame: &str, file: &str) -> Result<Listing> {
        parse(&format!(
            "{{\"frames\": [{{\"file_path\": \"a\\\\b.png\", \"transform_matrix\": {POSE}{frame}}}]{file}}}"
        ))
    }

    fn camera(frame: &str, file: &str, size: [u32; 2]) -> crate::camera::Camera {
        let entry = &one(frame, file).expect("valid").frames[0];
        entry.intrinsics.camera(size, entry.world_from_camera).0
    }

    #[test]
    fn the_frame_comes_before_the_file_and_pixels_before_angles() {
        let file = ", \"camera_angle_x\": 1.5707963267948966, \"fl_x\": 40, \"w\": 100, \"h\": 50";
        let focal = |frame| camera(frame, file, [100, 50]).focal_px.to_array();
        assert_eq!(focal(""), [40.0, 40.0]);
        assert_eq!(focal(", \"fl_x\": 30, \"fl_y\": 20"), [30.0, 20.0]);
        assert!((focal(", \"x_fov\": 90")[0] - 50.0).abs() < 1e-12);
        assert!((focal(", \"camera_angle_y\": 1.5707963267948966")[1] - 25.0).abs() < 1e-12);
        assert_eq!(focal(", \"K\": [[8,0,3],[0,9,4],[0,0,1]]"), [8.0, 9.0]);
        assert_eq!(focal(", \"intrinsics\": {\"fl_x\": 7}"), [7.0, 7.0]);
    }

    #[test]
    fn pixels_scale_with_the_image_they_belong_to() {
        let file = ", \"fl_x\": 40, \"cx\": 60, \"cy\": 20, \"w\": 100, \"h\": 50.4";
        let small = camera("", file, [50, 25]);
        assert!((small.center_px.x - 30.0).abs() < 1e-12 && (small.focal_px.x - 20.0).abs() < 1e-12);
        let same = camera("", file, [100, 50]);
        assert_eq!(same.center_px.to_array(), [60.0, 20.0]);
        let row_major = camera(", \"K\": [8,0,3, 0,9,4, 0,0,1]", "", [6, 8]);
        let column_major = camera(", \"K\": [8,0,0, 0,9,0, 3,4,1]", "", [6, 8]);
        assert_eq!(row_major.center_px, column_major.center_px);
    }

    #[test]
    fn boxes_mean_what_instant_ngp_means() {
        let scene = |file: &str| {
            let file = format!(", \"fl_x\": 1{file}");
            one("", &file).expect("valid").scene_box
        };
        assert_eq!(scene(""), None);
        let plain = scene(", \"aabb_scale\": 3").expect("has a box");
        assert_eq!((plain.scale, plain.aabb_scale), (0.33, 4));
        let explicit = scene(", \"aabb\": [[0, 0, 0], [2, 4, 1]], \"scale\": 9").expect("a box");
        assert_eq!(explicit.scale, 0.25);
        assert_eq!(explicit.offset.to_array(), [0.25, 0.0, 0.375]);
        assert_eq!(scene(", \"aabb_scale\": 1000").expect("a box").aabb_scale, 128);
    }

    #[test]
    fn split_lists_are_read() {
        let listing = one("", ", \"fl_x\": 1, \"test_filenames\": [\"./a/b.png\"]").expect("valid");
        assert_eq!(listing.frames[0].split, Some(Split::Test));
        assert_eq!(listing.frames[0].file_path, "a/b.png");
        assert_eq!(listing.dialect, "nerfstudio");
    }

    #[test]
    fn matrices_of_every_shape_become_rigid() {
        let pose = |matrix: &str| {
            let text = format!(
                "{{\"fl_x\": 1, \"frames\": [{{\"file_path\": \"a\", \"transform_matrix\": {matrix}}}]}}"
            );
            parse(&text).map(|listing| listing.frames[0].world_from_camera)
        };
        let expected = pose(POSE).expect("valid");
        for same in [
            "[[1,0,0,1],[0,1,0,2],[0,0,1,3]]",
            "[1,0,0,1, 0,1,0,2, 0,0,1,3, 0,0,0,1]",
            "[[0.5,0,0,1],[0,0.5,0,2],[0,0,0.5,3],[0,0,0,1]]",
            "[[2,0,0,2],[0,2,0,4],[0,0,2,6],[0,0,0,2]]",
        ] {
            assert_eq!(pose(same).expect("valid"), expected, "{same}");
        }
        let noisy = pose("[[1.02,0.01,0,1],[0,0.99,0,2],[0,0,1,3]]").expect("repaired");
        let product = noisy.matrix3.transpose() * noisy.matrix3;
        assert!(product.abs_diff_eq(glam::DMat3::IDENTITY, 1e-14));
    }
}
