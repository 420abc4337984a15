//! Cameras to render: a `transforms.json` whose images need not be there, or what other programs save of a camera path.
//!
//! Each of these is rewritten as the `transforms.json` that means the same.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use glam::{DMat3, DMat4, DQuat, DVec3};
use serde_json::{Map, Value, json};

use super::json::{self, Fields, REMEDY, describe, shortened};
use super::notes::Notes;
use super::pose::handedness;
use super::transforms;
use crate::camera::Camera;

/// What a view looks like whose file does not say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UsualView {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Focal length of a picture of that size, in pixels.
    pub focal_px: f64,
}

/// Reads the cameras of a single file, in its order, without looking for images: name and camera. Poses are in the
/// dataset's world. A nerfstudio camera path is taken to be as well, and one of instant-ngp to have the scale and the offset
/// that it has unless a dataset says otherwise.
///
/// # Errors
/// When the file cannot be read, or is none of these; names the file and the frame.
pub fn read_cameras(path: &Path, usual: UsualView) -> Result<Vec<(String, Camera)>> {
    let read = || -> Result<_> {
        let document = json::parse(&json::decode(&std::fs::read(path)?)?)?;
        let mut listings = [transforms::parse_document(&as_transforms(document, usual)?)?];
        handedness::settle(&mut listings, &mut Notes::default())?;
        Ok(listings)
    };
    let [listing] = read().with_context(|| format!("reading {}", path.display()))?;
    let camera = |entry: super::FrameEntry| {
        let size = entry.declared_size().unwrap_or(usual.size);
        (entry.file_path, entry.intrinsics.camera(size, entry.world_from_camera).0)
    };
    Ok(listing.frames.into_iter().map(camera).collect())
}

/// The document as a `transforms.json`, whose frames all have names.
fn as_transforms(document: Value, usual: UsualView) -> Result<Value> {
    let mut document = match &document {
        Value::Object(map) if map.contains_key("camera_path") => of_nerfstudio(Fields(map), usual)?,
        Value::Object(map) if map.contains_key("path") && !map.contains_key("frames") => {
            of_instant_ngp(Fields(map), usual)?
        }
        Value::Array(list) if list.iter().all(is_bare_pose) && !list.is_empty() => {
            let mut file = view(usual.size, usual.focal_px);
            file.insert("frames".to_owned(), document);
            Value::Object(file)
        }
        _ => document,
    };
    name_frames(&mut document);
    Ok(document)
}

/// What nerfstudio's exporter of cameras writes of each: no intrinsics.
fn is_bare_pose(frame: &Value) -> bool {
    let is_known = |key: &String| ["file_path", "transform"].contains(&key.as_str());
    frame.as_object().is_some_and(|frame| frame.contains_key("transform") && frame.keys().all(is_known))
}

/// Size and focal length as a `transforms.json` states them.
fn view([width, height]: [u32; 2], focal_px: f64) -> Map<String, Value> {
    let stated =
        [("w", json!(width)), ("h", json!(height)), ("fl_x", json!(focal_px)), ("fl_y", json!(focal_px))];
    stated.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

/// Gives the frames of an object, and of those in it, the names that they lack.
fn name_frames(value: &mut Value) {
    let list = match value {
        Value::Object(map) => {
            map.values_mut().filter(|inner| inner.is_object()).for_each(name_frames);
            map.get_mut("frames").and_then(Value::as_array_mut)
        }
        Value::Array(list) => Some(list),
        _ => None,
    };
    for (index, frame) in list.into_iter().flatten().enumerate() {
        if let Some(frame) = frame.as_object_mut().filter(|frame| !transforms::has_name(Fields(frame))) {
            frame.insert("file_path".to_owned(), json!(format!("camera {index}")));
        }
    }
}

/// A list of cameras that is not empty.
fn cameras<'a>(file: Fields<'a>, key: &str) -> Result<Vec<Fields<'a>>> {
    let list = file.list(key)?.unwrap_or_default();
    ensure!(!list.is_empty(), "`{key}` is empty; expected at least one camera, so save the path again");
    let object = |(index, value): (usize, &'a Value)| {
        let found = || format!("camera {index}: expected an object, found {}; {REMEDY}", describe(value));
        value.as_object().map(Fields).with_context(found)
    };
    list.iter().enumerate().map(object).collect()
}

/// The focal length in pixels of a vertical field of view in degrees.
fn focal_px(camera: Fields, height: u32) -> Result<f64> {
    let fov = camera.positive("fov", 180.0)?;
    let fov = fov.context("`fov` is missing; expected a vertical field of view in degrees, so write it")?;
    Ok(0.5 * f64::from(height) / (0.5 * fov.to_radians()).tan())
}

/// What nerfstudio's viewer saves.
fn of_nerfstudio(file: Fields, usual: UsualView) -> Result<Value> {
    let side = |key: &str, usual: u32| -> Result<u32> {
        Ok(file.positive(key, 65_536.0)?.map_or(usual, |side| (side as u32).max(1)))
    };
    let size = [side("render_width", usual.size[0])?, side("render_height", usual.size[1])?];
    let model = match file.text("camera_type")?.unwrap_or("perspective") {
        "perspective" => "PINHOLE",
        "fisheye" => "OPENCV_FISHEYE",
        "equirectangular" => "EQUIRECTANGULAR",
        other => bail!(
            "`camera_type` must be perspective, fisheye or equirectangular, found {:?}; save the path as one of them",
            shortened(other)
        ),
    };
    let frame = |(index, camera): (usize, &Fields)| -> Result<Value> {
        let read = || -> Result<_> {
            let mut frame = match model {
                "EQUIRECTANGULAR" => view(size, f64::from(size[0]) / std::f64::consts::TAU),
                _ => view(size, focal_px(*camera, size[1])?),
            };
            let pose = camera.get("camera_to_world");
            let pose = pose.context("`camera_to_world` is missing; save the path again")?;
            frame.insert("transform_matrix".to_owned(), pose.clone());
            frame.insert("camera_model".to_owned(), json!(model));
            Ok(Value::Object(frame))
        };
        read().with_context(|| format!("camera {index}"))
    };
    let cameras = cameras(file, "camera_path")?;
    let frames: Vec<Value> = cameras.iter().enumerate().map(frame).collect::<Result<_>>()?;
    Ok(json!({ "frames": frames }))
}

/// Unit-cube lengths of instant-ngp per world unit, and where the world's origin lies in the cube, unless a dataset says
/// otherwise.
const NGP_SCALE: f64 = 0.33;
const NGP_OFFSET: f64 = 0.5;

/// What instant-ngp saves: rotations as quaternions x, y, z, w, and positions in its unit cube.
fn of_instant_ngp(file: Fields, usual: UsualView) -> Result<Value> {
    let frame = |(index, camera): (usize, &Fields)| -> Result<Value> {
        let read = || -> Result<_> {
            let numbers = |key: &str, count: usize| -> Result<Vec<f64>> {
                let numbers = camera.numbers(key)?.unwrap_or_default();
                let is_right = numbers.len() == count && numbers.iter().all(|number| number.is_finite());
                ensure!(is_right, "`{key}` must be {count} finite numbers; save the path again");
                Ok(numbers)
            };
            let turn = DQuat::from_slice(&numbers("R", 4)?);
            ensure!(turn.length() > 1e-9, "`R` must be a quaternion, found zeros; save the path again");
            let place = DVec3::from_slice(&numbers("T", 3)?);
            // The cube's axes are the world's y, z, x; cameras look along +Z, with +Y down.
            let world_from_cube = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X);
            let axes = DMat3::from_quat(turn.normalize()) * DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
            let position = world_from_cube * (place - NGP_OFFSET) / NGP_SCALE;
            let pose = DMat4::from_mat3_translation(world_from_cube * axes, position);
            let mut frame = view(usual.size, focal_px(*camera, usual.size[1])?);
            frame.insert("transform_matrix".to_owned(), json!(pose.transpose().to_cols_array()));
            Ok(Value::Object(frame))
        };
        read().with_context(|| format!("camera {index}"))
    };
    let cameras = cameras(file, "path")?;
    let frames: Vec<Value> = cameras.iter().enumerate().map(frame).collect::<Result<_>>()?;
    Ok(json!({ "frames": frames }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;

    const USUAL: UsualView = UsualView { size: [40, 20], focal_px: 30.0 };

    fn read(document: &Value) -> Result<Vec<(String, Camera)>> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("path.json");
        std::fs::write(&path, document.to_string()).expect("written");
        read_cameras(&path, USUAL)
    }

    fn pose() -> Value {
        json!([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])
    }

    fn expected_pose() -> DAffine3 {
        let axes = DMat3::from_cols(DVec3::Y, DVec3::NEG_X, DVec3::Z);
        DAffine3::from_mat3_translation(axes, DVec3::new(1.0, 2.0, 3.0))
    }

    #[test]
    fn frames_need_no_names() {
        let document = json!({"fl_x": 9, "w": 16, "h": 8, "frames": [{"transform_matrix": pose()}, {"transform_matrix": pose(), "file_path": "a"}]});
        let cameras = read(&document).expect("valid");
        assert_eq!((cameras[0].0.as_str(), cameras[1].0.as_str()), ("camera 0", "a"));
        assert_eq!((cameras[0].1.width, cameras[0].1.world_from_camera), (16, expected_pose()));
    }

    #[test]
    fn exported_poses_are_seen_as_usual() {
        let document = json!([{"file_path": "images/1.jpg", "transform": pose()}]);
        let (name, camera) = read(&document).expect("valid").remove(0);
        assert_eq!((name.as_str(), camera.width, camera.height), ("images/1.jpg", 40, 20));
        assert_eq!((camera.focal_px.x, camera.center_px.y), (30.0, 10.0));
        assert_eq!(camera.world_from_camera, expected_pose());
    }

    #[test]
    fn paths_of_nerfstudio_have_vertical_fields_of_view() {
        let flat = json!([0, -1, 0, 1, 1, 0, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1]);
        let path = |kind: &str| {
            json!({"camera_type": kind, "render_height": 100, "render_width": 50,
                "camera_path": [{"camera_to_world": flat, "fov": 90, "aspect": 0.5}]})
        };
        let (_, camera) = read(&path("perspective")).expect("valid").remove(0);
        assert_eq!((camera.width, camera.height), (50, 100));
        assert!((camera.focal_px - 50.0).length() < 1e-12, "{}", camera.focal_px);
        assert_eq!(camera.world_from_camera, expected_pose());
        for kind in ["fisheye", "equirectangular"] {
            let (_, camera) = read(&path(kind)).expect("valid").remove(0);
            assert_eq!(camera.lens.kind().name(), kind);
        }
        let message = |document: &Value| format!("{:#}", read(document).expect_err("refused"));
        assert!(message(&path("vr180_l")).contains("must be perspective, fisheye or equirectangular"));
        assert!(message(&json!({"camera_path": []})).contains("`camera_path` is empty"));
        assert!(
            message(&json!({"camera_path": [{"fov": 9}]})).contains("camera 0: `camera_to_world` is missing")
        );
    }

    #[test]
    fn paths_of_instant_ngp_leave_its_cube() {
        let path = |turn: Value, place: Value| json!({"path": [{"R": turn, "T": place, "fov": 90.0}]});
        let (_, camera) =
            read(&path(json!([0, 0, 0, 1]), json!([0.5, 0.83, 0.17]))).expect("valid").remove(0);
        // One world unit along z, one back along x; it looks along the cube's z, which is the world's x.
        assert!(camera.position().distance(DVec3::new(-1.0, 0.0, 1.0)) < 1e-12, "{}", camera.position());
        assert!(camera.forward().distance(DVec3::X) < 1e-12, "{}", camera.forward());
        let down = -camera.world_from_camera.matrix3.y_axis;
        assert!(down.distance(DVec3::Z) < 1e-12, "{down}");
        assert_eq!((camera.width, camera.height), (40, 20));
        assert!((camera.focal_px.y - 10.0).abs() < 1e-12);
        let refused = read(&path(json!([0, 0, 0, 0]), json!([0, 0, 0]))).expect_err("refused");
        assert!(format!("{refused:#}").contains("camera 0: `R` must be a quaternion"), "{refused:#}");
    }
}
