//! The `transforms.json` family: what one file lists, before any image is looked for.

mod dialect;
mod ngp_box;
mod outline;
mod split_lists;
mod unheeded;

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;

use super::intrinsics::{self, Intrinsics, Stated};
use super::json::{self, Fields, REMEDY, describe, shortened};
use super::listing::{FrameEntry, Listing, SceneBox};
use super::notes::Notes;
use super::pose::{self, Axes, handedness};
use super::sidecars;
use crate::capture::image_file::ColorKey;
use outline::Section;

/// Parses files of one dataset, whose poses follow one rule. Errors name the file, the frame and the key.
pub(super) fn read(paths: &[&Path], notes: &mut Notes) -> Result<Vec<Listing>> {
    let read = |path: &Path| parse_alone(&json::decode(&std::fs::read(path)?)?);
    let named = |path: &&Path| read(path).with_context(|| format!("reading {}", path.display()));
    let mut listings: Vec<Listing> = paths.iter().map(named).collect::<Result<_>>()?;
    let context = || paths.first().map_or_else(String::new, |path| format!("reading {}", path.display()));
    handedness::settle(&mut listings, notes).with_context(context)?;
    Ok(listings)
}

/// Parses the bytes of one file. Errors name the frame and the key.
///
/// # Errors
/// When it cannot be understood.
pub fn parse_bytes(bytes: &[u8]) -> Result<Listing> {
    parse(&json::decode(bytes)?)
}

/// Parses the text of one file. Errors name the frame and the key.
///
/// # Errors
/// When it cannot be understood.
pub fn parse(text: &str) -> Result<Listing> {
    let mut listings = [parse_alone(text)?];
    let mut notes = Notes::default();
    handedness::settle(&mut listings, &mut notes)?;
    let [mut listing] = listings;
    listing.notes.append(notes);
    Ok(listing)
}

/// As [`parse`], without a look at whether poses are mirrored.
pub(super) fn parse_alone(text: &str) -> Result<Listing> {
    parse_document(&json::parse(text)?)
}

/// As [`parse_alone`], of JSON that was parsed.
pub(super) fn parse_document(document: &Value) -> Result<Listing> {
    let sections = outline::sections(document)?;
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
    let around = sections.first().map_or(&[][..], |section| &section.around);
    let mut scene_box = None;
    let mut point_cloud = None;
    for &file in around {
        let named = file.get("ply_file_path").and_then(Value::as_str);
        point_cloud = point_cloud.or(named.map(|name| name.replace('\\', "/")));
        split_lists::assign(file, &mut entries, &mut notes)?;
        scene_box = scene_box.or(SceneBox::read(file, &mut notes)?);
    }
    let frames = sections.iter().flat_map(|section| &section.frames);
    let frames: Vec<Fields> = frames.filter_map(|(_, frame)| frame.as_object().map(Fields)).collect();
    unheeded::tell(around.first().copied(), &frames, &mut notes);
    let dialect = dialect::name(around.first().copied(), frames.first().copied());
    Ok(Listing { frames: entries, scene_box, point_cloud, dialect, notes })
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
struct File<'a> {
    section: &'a Section<'a>,
    axes: Axes,
    color_key: ColorKey,
    intrinsics: Vec<Stated>,
}

impl<'a> File<'a> {
    fn read(section: &'a Section<'a>, notes: &mut Notes) -> Result<Self> {
        let color_key = ColorKey::default();
        let mut file = Self { section, axes: Axes::OpenGl, color_key, intrinsics: Vec::new() };
        for &fields in &section.around {
            let axes = Axes::of(fields)?;
            file.axes = if file.axes == Axes::OpenGl { axes } else { file.axes };
            file.intrinsics.extend(stated(fields, "the file", notes)?);
            file.color_key.white |= fields.flag("white_transparent")? == Some(true);
            file.color_key.black |= fields.flag("black_transparent")? == Some(true);
        }
        if let Some(colors) = file.color_key.words() {
            notes.note(format!("pixels of pure {colors} are transparent, as the file asks for"));
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
    ) -> Result<Option<FrameEntry>> {
        let Value::Object(map) = frame else {
            bail!("expected an object, found {}; {REMEDY}", describe(frame));
        };
        let fields = Fields(map);
        let file_path = file_path(fields, key)?;
        let (mask_path, depth) =
            sidecars::listed(fields, self.section.around.first().copied().unwrap_or(fields))?;
        let own = stated(fields, label, notes)?;
        let layers: Vec<&Stated> = own.iter().chain(&self.intrinsics).collect();
        let intrinsics = Intrinsics::resolve(&layers, label, notes)?;
        let Some(world_from_camera) = pose::read(fields, self.axes, label, notes)? else {
            return Ok(None);
        };
        Ok(Some(FrameEntry {
            label: label.to_owned(),
            file_path,
            intrinsics,
            world_from_camera,
            split: self.section.split,
            mask_path,
            depth,
            color_key: self.color_key,
        }))
    }
}

/// What an object and those nested in it state about the camera, in falling priority.
fn stated(fields: Fields, owner: &str, notes: &mut Notes) -> Result<Vec<Stated>> {
    let nested = fields.objects(&intrinsics::OBJECTS);
    std::iter::once(fields).chain(nested).map(|fields| Stated::read(fields, owner, notes)).collect()
}

/// Whether a frame names its image.
pub(super) fn has_name(frame: Fields) -> bool {
    frame.has(&NAME_KEYS)
}

/// The name of the image, with forward slashes.
fn file_path(fields: Fields, key: Option<&str>) -> Result<String> {
    for name_key in NAME_KEYS {
        if let Some(path) = fields.text(name_key)? {
            let path = path.trim().strip_prefix("file://").unwrap_or(path.trim()).replace('\\', "/");
            ensure!(
                !path.is_empty(),
                "`{name_key}` is empty; every frame needs the name of its image, so write it"
            );
            return Ok(path);
        }
    }
    key.map(|key| key.replace('\\', "/"))
        .context("`file_path` is missing; every frame needs the name of its image, so write it")
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
pub(super) mod tests {
    use super::*;
    use crate::photo::Split;
    use glam::DAffine3;
    use serde_json::{Map, json};

    /// A file with one frame, each with more keys.
    pub(in crate::capture::dataset) fn one(frame: Value, file: Value) -> Listing {
        let mut all =
            json!({"file_path": "a", "transform_matrix": [[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]});
        let object = |value: Value| value.as_object().cloned().unwrap_or_else(Map::new);
        all.as_object_mut().expect("an object").extend(object(frame));
        let mut document = object(file);
        document.insert("frames".to_owned(), json!([all]));
        let text = Value::Object(document).to_string();
        parse(&text).unwrap_or_else(|error| panic!("{text}: {error:#}"))
    }

    fn messages(listing: &Listing) -> String {
        listing.notes().iter().map(|note| format!("{note}\n")).collect()
    }

    /// Frames of these names at rising positions.
    fn frames(names: &[&str]) -> Vec<Value> {
        let frame = |(x, name): (usize, &&str)| json!({"file_path": name, "transform_matrix": [1,0,0,x, 0,1,0,0, 0,0,1,4]});
        names.iter().enumerate().map(frame).collect()
    }

    #[test]
    fn listed_names_are_found_in_many_spellings() {
        let names =
            ["./images/1.png", r"images\2.png", "images/3", "deep/images/4.jpg", "left/5.png", "right/5.png"];
        let split = |name: &str| {
            let document =
                json!({"fl_x": 9, "test_filenames": [name, "images/1.png"], "frames": frames(&names)});
            let listing = parse(&document.to_string()).expect("valid");
            let chosen = listing.frames.iter().skip(1).filter(|entry| entry.split == Some(Split::Test));
            chosen.map(|entry| entry.world_from_camera.translation.x as usize).collect::<Vec<_>>()
        };
        for (name, expected) in [
            ("images/2.png", 1),
            (r".\images\2.png", 1),
            ("images/2", 1),
            (r"C:\data\images\2.png", 1),
            ("/home/me/images/3.jpg", 2),
            ("images//./3", 2),
            ("images/4.jpg", 3),
            ("4", 3),
            ("left/5.png", 4),
            ("/data/right/5", 5),
        ] {
            assert_eq!(split(name), [expected], "{name}");
        }
        assert!(split("5.png").is_empty(), "two frames have that name");
        assert!(split("images/9.png").is_empty());
    }

    #[test]
    fn frames_are_found_in_many_places() {
        let two = || frames(&["a.png", "b.png"]);
        let named = json!({"a": {"transform_matrix": [1,0,0,0, 0,1,0,0, 0,0,1,4]}});
        let (train, test) = (Some(Split::Train), Some(Split::Test));
        for (document, expected) in [
            (json!({"fl_x": 9, "frames": two()}), vec![None, None]),
            (json!({"fl_x": 9, "frames": named}), vec![None]),
            (json!({"fl_x": 9, "data": {"frames": two()}}), vec![None, None]),
            (json!({"data": {"fl_x": 9, "frames": two()}}), vec![None, None]),
            (
                json!({"fl_x": 9, "test": {"frames": two()}, "train": {"frames": named}}),
                vec![test, test, train],
            ),
            (json!({"fl_x": 9, "frames": two(), "test_frames": frames(&["c"])}), vec![train, train, test]),
        ] {
            let listing =
                parse(&document.to_string()).unwrap_or_else(|error| panic!("{document}: {error:#}"));
            let splits: Vec<_> = listing.frames.iter().map(|entry| entry.split).collect();
            assert_eq!(splits, expected, "{document}");
        }
        for key in NAME_KEYS {
            let text = json!({"fl_x": 9, "frames": two()}).to_string().replace("file_path", key);
            assert_eq!(parse(&text).expect("valid").frames[1].file_path, "b.png");
        }
    }

    #[test]
    fn boxes_mean_what_instant_ngp_means() {
        let scene = |file: Value| {
            let mut file = file;
            file["fl_x"] = json!(1);
            one(json!({}), file).scene_box
        };
        assert_eq!(scene(json!({})), None);
        let plain = scene(json!({"aabb_scale": 3})).expect("has a box");
        assert_eq!((plain.scale, plain.aabb_scale), (0.33, 4));
        let explicit = scene(json!({"aabb": [[0, 0, 0], [2, 4, 1]], "scale": 9})).expect("a box");
        assert_eq!((explicit.scale, explicit.offset.to_array()), (0.25, [0.25, 0.0, 0.375]));
        assert_eq!(scene(json!({"aabb_scale": 1000})).expect("a box").aabb_scale, 128);
        let mitsuba = scene(json!({"aabb_scale": 1, "from_mitsuba": true})).expect("a box");
        assert_eq!((mitsuba.scale, mitsuba.offset.x), (0.66, 0.165));
    }

    #[test]
    fn keys_of_others_are_told() {
        let said = |frame: Value, file: Value| {
            let mut file = file;
            file["fl_x"] = json!(9);
            messages(&one(frame, file))
        };
        let idle = json!({"sharpen": 0, "n_frames": 3, "orientation_override": "none", "envmap": null});
        assert_eq!(said(json!({"time": 0.5, "rolling_shutter": [0, 0, 0]}), idle), "");
        let all = said(
            json!({"driver_parameters": {"LightX": 1}, "fisheye_crop_radius": 9}),
            json!({"sharpen": 0.5, "black_transparent": "True"}),
        );
        for key in ["sharpen", "driver_parameters", "fisheye_crop_radius"] {
            assert!(all.contains(&format!("`{key}` is not heeded")), "{all}");
        }
        assert!(all.contains("pixels of pure black are"), "{all}");
        let mut moving = frames(&["a", "b", "c"]);
        moving.iter_mut().enumerate().for_each(|(index, frame)| frame["time"] = json!(0.5 * index as f64));
        let document = json!({"fl_x": 9, "n_frames": 2, "frames": moving}).to_string();
        let moving = messages(&parse(&document).expect("valid"));
        assert!(moving.contains("as if it stood still") && moving.contains("`n_frames`"), "{moving}");
    }

    /// The pose of one frame and what is said about it.
    fn pose(frame: Value, file: Value) -> (DAffine3, String) {
        let (mut frame, mut file) = (frame, file);
        file["fl_x"] = json!(9);
        if frame.get("transform_matrix").is_none() {
            frame["transform_matrix"] = Value::Null;
        }
        let listing = one(frame, file);
        (listing.frames[0].world_from_camera, messages(&listing))
    }

    #[test]
    fn matrices_of_every_shape_become_rigid() {
        let read = |matrix: Value| pose(json!({"transform_matrix": matrix}), json!({}));
        let (expected, said) = read(json!([[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]));
        assert_eq!(said, "");
        for same in [
            json!([[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3]]),
            json!([1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1]),
            json!([["1", 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, "3.0"]]),
            json!([[0.5, 0, 0, 1], [0, 0.5, 0, 2], [0, 0, 0.5, 3], [0, 0, 0, 1]]),
            json!([[1e-90, 0, 0, 1], [0, 1e-90, 0, 2], [0, 0, 1e-90, 3], [0, 0, 0, 1]]),
            json!([[2, 0, 0, 2], [0, 2, 0, 4], [0, 0, 2, 6], [0, 0, 0, 2]]),
        ] {
            assert_eq!(read(same.clone()).0, expected, "{same}");
        }
        for (last, largest) in [([0.0, 0.0, 0.0, 0.99], "1.00e-2"), ([1e-3, -0.02, 3e-5, 1.01], "2.00e-2")] {
            let (found, said) = read(json!([[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], last]));
            assert_eq!(found, expected, "{last:?}");
            assert!(said.contains("must be 0 0 0 1 and is off by up to") && said.contains(largest), "{said}");
        }
        let (noisy, said) = read(json!([[1.02, 0.01, 0, 1], [0, 0.99, 0, 2], [0, 0, 1, 3]]));
        let product = noisy.matrix3.transpose() * noisy.matrix3;
        assert!(product.abs_diff_eq(glam::DMat3::IDENTITY, 1e-14));
        assert!(said.contains("not quite perpendicular"), "{said}");
    }

    #[test]
    fn matrices_of_other_conventions_become_right_up_back() {
        let rows = json!([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]);
        let (expected, said) = pose(json!({"transform_matrix": rows}), json!({}));
        assert_eq!((expected.matrix3.x_axis, said.as_str()), (glam::DVec3::Y, ""));
        for same in [
            json!([[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [1, 2, 3, 1]]),
            json!([0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1]),
            json!([[0, 1, 0], [-1, 0, 0], [0, 0, 1], [1, 2, 3]]),
        ] {
            let (found, said) = pose(json!({"transform_matrix": same}), json!({}));
            assert_eq!(found, expected, "{same}");
            assert!(said.contains("it was transposed"), "{said}");
        }
        let open_cv = json!([[0, 1, 0, 1], [1, 0, 0, 2], [0, 0, -1, 3]]);
        assert_eq!(pose(json!({"camtoworld": open_cv}), json!({})).0, expected);
        assert_eq!(pose(json!({"transform_matrix": open_cv}), json!({"from_na": true})).0, expected);
        let mitsuba = json!([[0, 1, 0, 1], [-1, 0, 0, 2], [0, 0, 1, 3]]);
        assert_eq!(pose(json!({"transform_matrix": mitsuba}), json!({"from_mitsuba": true})).0, expected);
        let later = json!([[0, -1, 0, 2], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]);
        let moving = json!({"transform_matrix_start": rows, "transform_matrix_end": later});
        let (found, said) = pose(moving, json!({}));
        assert_eq!(found.translation.to_array(), [1.5, 2.0, 3.0]);
        assert!(said.contains("halfway"), "{said}");
    }
}
