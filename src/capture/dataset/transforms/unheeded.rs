//! Keys that other tools act on and that are not heeded here: each is said once, so that none is silently ignored.

use serde_json::Value;

use crate::capture::dataset::json::Fields;
use crate::capture::dataset::notes::Notes;
use crate::capture::diagnostics::Severity::{self, Note, Warning};

/// Keys, whether they stand in the file or in frames, how much it matters, who does what by them, and what is done here.
const KEYS: [(&str, Severity, &str, &str); 25] = [
    ("sharpen", Note, "instant-ngp sharpens the photos by it", "photos are used as they are"),
    (
        "sharpness_discard_threshold",
        Note,
        "instant-ngp leaves out frames that are less sharp than those around them by it",
        "all frames are used",
    ),
    ("n_frames", Note, "instant-ngp reads so many frames and no more", "all frames are used"),
    (
        "fix_premult",
        Note,
        "instant-ngp divides colours by alpha for it",
        "the pixels tell whether they are multiplied",
    ),
    (
        "envmap",
        Warning,
        "instant-ngp shows that picture behind the scene",
        "what is far away is learnt with the scene",
    ),
    (
        "enable_ray_loading",
        Warning,
        "instant-ngp reads the rays of pixels from files",
        "rays follow from the cameras",
    ),
    (
        "n_extra_learnable_dims",
        Note,
        "instant-ngp learns so many numbers for the look of each photo",
        "all photos are taken to look alike",
    ),
    (
        "render_aabb",
        Note,
        "instant-ngp cuts off what is outside when it renders",
        "the scene's whole box is rendered",
    ),
    (
        "rolling_shutter",
        Warning,
        "instant-ngp moves the camera from row to row by it",
        "all rows are taken for exposed at once",
    ),
    (
        "driver_parameters",
        Warning,
        "instant-ngp takes the direction of the light from it",
        "the light is taken to stay as it is",
    ),
    ("orientation_override", Note, "nerfstudio turns the poses by it", "poses are used as they are"),
    ("auto_scale_poses_override", Note, "nerfstudio scales the poses by it", "poses are used as they are"),
    (
        "scene_box",
        Note,
        "SDFStudio takes the box and the distances of the scene from it",
        "the box follows from the cameras",
    ),
    ("worldtogt", Note, "SDFStudio turns meshes back by it", "results are in the world of the poses"),
    (
        "fisheye_crop_radius",
        Note,
        "nerfstudio leaves out what is farther from the middle of fisheye pictures",
        "all pixels count; `mask_path` leaves some out",
    ),
    ("semantics", Note, "nerfstudio learns classes from it", "no classes are learnt"),
    ("semantic_path", Note, "nerfstudio learns classes from those files", "no classes are learnt"),
    ("seg_file_path", Note, "semantic methods learn classes from those files", "no classes are learnt"),
    ("normal_file_path", Note, "nerfstudio learns normals from those files", "no normals are learnt"),
    ("normal_path", Note, "nerfstudio learns normals from those files", "no normals are learnt"),
    ("mono_normal_path", Note, "SDFStudio learns normals from those files", "no normals are learnt"),
    (
        "mono_depth_path",
        Note,
        "SDFStudio learns depth up to a scale from those files",
        "no such depth is learnt",
    ),
    (
        "sensor_depth_path",
        Note,
        "SDFStudio learns depth from those files",
        "they are not read; `depth_file_path` is",
    ),
    (
        "foreground_mask",
        Warning,
        "SDFStudio takes what is in front from those files",
        "they are not read; `mask_path` is",
    ),
    (
        "rolling_shutter_time",
        Warning,
        "splatting against motion blur moves the camera by it",
        "all rows are taken for exposed at once",
    ),
];

/// Says what keys of a file and its frames are not heeded.
pub(super) fn tell(file: Option<Fields>, frames: &[Fields], notes: &mut Notes) {
    let has = |key: &str| file.iter().chain(frames).any(|fields| fields.get(key).is_some_and(asks));
    for (key, severity, effect, instead) in KEYS {
        let takes_all = key == "n_frames" && file.is_none_or(|file| takes(file, frames.len()));
        if has(key) && !takes_all {
            notes.say(severity, format!("`{key}` is not heeded: {effect}; here {instead}"));
        }
    }
    let mut times = frames.iter().filter_map(|frame| frame.get("time")?.as_f64());
    let first = times.next();
    if times.any(|time| Some(time) != first) {
        notes.warn(
            "`time` differs from frame to frame, as D-NeRF has it for a scene that moves: it is trained as if it stood \
             still, and what moves comes out as haze; keep the frames of one time for a sharp result",
        );
    }
}

/// Whether `n_frames` leaves no frame out.
fn takes(file: Fields, frames: usize) -> bool {
    file.get("n_frames").and_then(Value::as_f64).is_none_or(|count| count < 1.0 || count >= frames as f64)
}

/// Whether a value asks for anything.
fn asks(value: &Value) -> bool {
    match value {
        Value::Null => false,
        Value::Bool(flag) => *flag,
        Value::Number(number) => number.as_f64() != Some(0.0),
        Value::String(text) => !matches!(text.trim(), "" | "none" | "None"),
        Value::Array(list) => list.iter().any(asks),
        Value::Object(map) => map.values().any(asks),
    }
}
