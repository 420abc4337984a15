//! The `transforms.json` family: what one file lists, before any image is looked for.

mod dialect;
mod outline;
mod scene_box;
mod split_lists;

use anyhow::{Context, Result, bail, ensure};
use glam::DAffine3;
use serde_json::Value;

use super::Split;
use super::intrinsics::{self, Intrinsics, Stated};
use super::json::{self, Fields, describe, shortened};
use super::notes::{Note, Notes, Severity};
use super::pose::{self, Axes, handedness};
use outline::Section;
pub use scene_box::SceneBox;

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
    /// Camera-to-world pose: an orthonormal matrix, improper where the world is left-handed, and a position.
    pub world_from_camera: DAffine3,
    /// The split that the file's own lists put the frame in.
    pub split: Option<Split>,
}

impl Listing {
    /// What is to be said about how the file was read.
    pub fn notes(&self) -> Vec<Note> {
        self.notes.clone().finish()
    }
}

/// Parses the bytes of one file. Errors name the frame and the key.
pub fn parse_bytes(bytes: &[u8]) -> Result<Listing> {
    parse(&json::decode(bytes)?)
}

/// Parses the text of one file. Errors name the frame and the key.
pub fn parse(text: &str) -> Result<Listing> {
    let document = json::parse(text)?;
    let sections = outline::sections(&document)?;
    let mut notes = Notes::default();
    let mut entries = Vec::new();
    let mut unposed = Vec::new();
    for section in &sections {
        let file = File::read(section, &mut notes)?;
        for (index, &(key, frame)) in section.frames.iter().enumerate() {
            let label = label(index, key, frame);
            let read = file.entry(key, frame, &label, &mut notes).with_context(|| label.clone())?;
            match read {
                Some(entry) => entries.push(entry),
                None => unposed.push(label),
            }
        }
    }
    report_unposed(&unposed, entries.len(), &mut notes)?;
    handedness::settle(&mut entries, &mut notes)?;
    let around = sections.first().map_or(&[][..], |section| &section.around);
    let mut scene_box = None;
    for &file in around {
        split_lists::assign(file, &mut entries, &mut notes)?;
        scene_box = scene_box.or(SceneBox::read(file, &mut notes)?);
    }
    let first = sections.iter().find_map(|section| section.frames.first()?.1.as_object());
    let dialect = dialect::name(around.first().copied(), first.map(Fields));
    Ok(Listing { frames: entries, scene_box, dialect, notes })
}

/// Keys under which tools write the name of the image.
const NAME_KEYS: [&str; 9] =
    ["file_path", "image_path", "file_name", "filename", "rgb_path", "img_path", "image", "path", "name"];

fn label(index: usize, key: Option<&str>, frame: &Value) -> String {
    let name = NAME_KEYS.iter().find_map(|key| frame.get(key)?.as_str()).or(key);
    match name {
        Some(path) => format!("frame {index} '{}'", shortened(path)),
        None => format!("frame {index}"),
    }
}

/// What the objects around the frames say for all of them.
struct File {
    split: Option<Split>,
    axes: Axes,
    intrinsics: Vec<Stated>,
}

impl File {
    fn read(section: &Section, notes: &mut Notes) -> Result<Self> {
        let mut file = Self { split: section.split, axes: Axes::OpenGl, intrinsics: Vec::new() };
        for &fields in &section.around {
            let axes = Axes::of(fields)?;
            file.axes = if file.axes == Axes::OpenGl { axes } else { file.axes };
            file.intrinsics.extend(stated(fields, "the file", notes)?);
        }
        Ok(file)
    }

    /// Reads a frame, or `None` where its pose is not finite.
    fn entry(
        &self,
        key: Option<&str>,
        frame: &Value,
        label: &str,
        notes: &mut Notes,
    ) -> Result<Option<Entry>> {
        let Value::Object(map) = frame else {
            bail!("expected an object, found {}", describe(frame));
        };
        let fields = Fields(map);
        let file_path = file_path(fields, key)?;
        if fields.has(&["mask_path"]) {
            let message = "masks (`mask_path`) are not used; the masked pixels are trained on";
            notes.frame(Severity::Warning, label, message);
        }
        let own = stated(fields, label, notes)?;
        let layers: Vec<&Stated> = own.iter().chain(&self.intrinsics).collect();
        let intrinsics = Intrinsics::resolve(&layers, label, notes)?;
        let Some(world_from_camera) = pose::read(fields, self.axes, label, notes)? else {
            return Ok(None);
        };
        let label = label.to_owned();
        Ok(Some(Entry { label, intrinsics, world_from_camera, split: self.split, file_path }))
    }
}

/// What an object and those nested in it state about the camera, in falling priority.
fn stated(fields: Fields, owner: &str, notes: &mut Notes) -> Result<Vec<Stated>> {
    let nested = fields.objects(&intrinsics::OBJECTS);
    std::iter::once(fields).chain(nested).map(|fields| Stated::read(fields, owner, notes)).collect()
}

/// The name of the image, with forward slashes.
fn file_path(fields: Fields, key: Option<&str>) -> Result<String> {
    for name_key in NAME_KEYS {
        if let Some(path) = fields.text(name_key)? {
            let path = path.trim().strip_prefix("file://").unwrap_or(path.trim()).replace('\\', "/");
            ensure!(!path.is_empty(), "`{name_key}` is empty; every frame needs the name of its image");
            return Ok(path);
        }
    }
    key.map(|key| key.replace('\\', "/"))
        .context("`file_path` is missing; every frame needs the name of its image")
}

/// Exporters write NaN where an image was not registered.
fn report_unposed(unposed: &[String], posed: usize, notes: &mut Notes) -> Result<()> {
    let Some(first) = unposed.first() else {
        return Ok(());
    };
    ensure!(
        posed > 0,
        "{first}: `transform_matrix` is not finite, and so in every frame; register the images again"
    );
    let more = if unposed.len() > 1 { format!(" and {} more", unposed.len() - 1) } else { String::new() };
    notes.warn(format!(
        "{} of {} frames have no finite `transform_matrix` and are left out: {first}{more}",
        unposed.len(),
        posed + unposed.len()
    ));
    Ok(())
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
