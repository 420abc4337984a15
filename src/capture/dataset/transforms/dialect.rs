//! Which family of tools wrote a file, from the keys that only they write.

use crate::capture::dataset::json::{Fields, Matrix};

/// What a user calls the origin of a file; `frame` is its first frame, if that is an object.
pub(super) fn name(file: Option<Fields>, frame: Option<Fields>) -> &'static str {
    let has = |fields: Option<Fields>, keys: &[&str]| fields.is_some_and(|fields| fields.has(keys));
    let in_file = |keys: &[&str]| has(file, keys);
    let in_frame = |keys: &[&str]| has(frame, keys);
    if in_frame(&["camtoworld"]) {
        "SDFStudio"
    } else if in_file(&["from_na"]) || in_frame(&["intrinsic_matrix"]) {
        "NeuS2"
    } else if in_file(&["test_frames"]) {
        "nerfstudio (ScanNet++)"
    } else if in_frame(&["transform"]) && !in_frame(&["transform_matrix"]) {
        "nerfstudio (exported cameras)"
    } else if in_file(&NERFSTUDIO) || in_frame(&["camera_model", "colmap_im_id"]) {
        file.map_or("nerfstudio", |file| nerfstudio(file, frame))
    } else if in_file(&["integer_depth_scale"]) && in_frame(&["depth_path"]) && in_frame(&["fl_x"]) {
        "instant-ngp (NeRFCapture)"
    } else if in_file(&NGP) || in_frame(&["is_fisheye", "sharpness"]) {
        "instant-ngp"
    } else if in_file(&["camera_angle_x", "camera_angle_y"]) {
        "blender"
    } else {
        "per-frame intrinsics"
    }
}

const NERFSTUDIO: [&str; 9] = [
    "camera_model",
    "applied_transform",
    "applied_scale",
    "ply_file_path",
    "orientation_override",
    "train_filenames",
    "val_filenames",
    "test_filenames",
    "auto_scale_poses_override",
];

const NGP: [&str; 13] = [
    "aabb_scale",
    "aabb",
    "offset",
    "fl_x",
    "k1",
    "x_fov",
    "is_fisheye",
    "n_frames",
    "from_mitsuba",
    "render_aabb",
    "envmap",
    "white_transparent",
    "integer_depth_scale",
];

/// Which of the converters of `ns-process-data` wrote it, where that leaves a trace.
fn nerfstudio(file: Fields, frame: Option<Fields>) -> &'static str {
    let in_frame = |keys: &[&str]| frame.is_some_and(|frame| frame.has(keys));
    let is_text =
        |key: &str, expected: &str| file.get(key).and_then(|value| value.as_str()) == Some(expected);
    let applied = file.matrix("applied_transform").ok().flatten();
    if in_frame(&["colmap_im_id"]) || applied.as_ref().is_some_and(is_from_colmap) {
        "nerfstudio (COLMAP)"
    } else if applied.as_ref().is_some_and(is_from_metashape) {
        "nerfstudio (Metashape)"
    } else if is_text("ply_file_path", "reconstruction.ply") {
        "nerfstudio (OpenDroneMap)"
    } else if is_text("orientation_override", "none") && in_frame(&["fl_x"]) {
        // Both are converted without turning the scene; only Polycam's photos are undistorted already.
        if in_frame(&["k1", "p1"]) { "nerfstudio (RealityCapture)" } else { "nerfstudio (Polycam)" }
    } else {
        "nerfstudio"
    }
}

/// COLMAP's axes are turned so that z points up, in two ways over the years.
fn is_from_colmap(matrix: &Matrix) -> bool {
    let now = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0];
    let once = [0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0];
    matrix.numbers == now || matrix.numbers == once
}

/// Metashape's axes are cycled.
fn is_from_metashape(matrix: &Matrix) -> bool {
    matrix.numbers == [0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]
}

#[cfg(test)]
mod tests {
    use crate::capture::dataset::transforms::{parse, tests::one};
    use serde_json::json;

    #[test]
    fn tools_are_told_by_what_only_they_write() {
        let own = json!({"fl_x": 9, "cx": 4, "cy": 3, "w": 8, "h": 6});
        let with = |key: &str| {
            let mut frame = own.clone();
            frame[key] = json!(0.1);
            frame
        };
        let depth = {
            let mut frame = own.clone();
            frame["depth_path"] = json!("a.png");
            frame
        };
        let unturned = json!({"camera_model": "OPENCV", "orientation_override": "none"});
        let colmap = json!({"applied_transform": [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]], "fl_x": 9});
        let metashape = json!({"applied_transform": [[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0]]});
        for (frame, file, expected) in [
            (json!({}), json!({"camera_angle_x": 0.7}), "blender"),
            (json!({}), json!({"aabb_scale": 4, "camera_angle_x": 0.7}), "instant-ngp"),
            (json!({"sharpness": 4}), json!({"camera_angle_x": 0.7}), "instant-ngp"),
            (depth, json!({"integer_depth_scale": 1e-4}), "instant-ngp (NeRFCapture)"),
            (own.clone(), json!({"camera_model": "OPENCV"}), "nerfstudio"),
            (with("colmap_im_id"), json!({"camera_model": "OPENCV"}), "nerfstudio (COLMAP)"),
            (json!({}), colmap, "nerfstudio (COLMAP)"),
            (own.clone(), metashape, "nerfstudio (Metashape)"),
            (own.clone(), unturned.clone(), "nerfstudio (Polycam)"),
            (with("k1"), unturned, "nerfstudio (RealityCapture)"),
            (own.clone(), json!({"ply_file_path": "reconstruction.ply"}), "nerfstudio (OpenDroneMap)"),
            (own.clone(), json!({"test_frames": []}), "nerfstudio (ScanNet++)"),
            (own.clone(), json!({"from_na": true}), "NeuS2"),
            (own.clone(), json!({}), "per-frame intrinsics"),
        ] {
            assert_eq!(one(frame.clone(), file.clone()).dialect, expected, "{frame} {file}");
        }
        let list = r#"[{"file_path": "a", "fl_x": 9, "transform": [1,0,0,0, 0,1,0,0, 0,0,1,4]}]"#;
        assert_eq!(parse(list).expect("valid").dialect, "nerfstudio (exported cameras)");
        let other = list.replace("transform", "camtoworld").replace("file_path", "rgb_path");
        assert_eq!(parse(&other).expect("valid").dialect, "SDFStudio");
    }
}
