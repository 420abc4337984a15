//! Documents as tools write them, and what may happen to them.

use proptest::collection::vec;
use proptest::prelude::*;
use serde_json::{Value, json};

/// Documents as the known tools write them.
pub(crate) fn seeds() -> Vec<Value> {
    let pose =
        |x: f64| json!([[1.0, 0.0, 0.0, x], [0.0, 0.8, -0.6, 2.0], [0.0, 0.6, 0.8, 3.0], [0, 0, 0, 1]]);
    let frame = |index: u32, more: Value| {
        let path = format!("images/{index:04}.png");
        let mut frame = json!({"file_path": path, "transform_matrix": pose(f64::from(index))});
        if let (Value::Object(frame), Value::Object(more)) = (&mut frame, more) {
            frame.extend(more);
        }
        frame
    };
    let frames = |more: Value| (0..4).map(|index| frame(index, more.clone())).collect::<Vec<_>>();
    vec![
        json!({"camera_angle_x": 0.69, "frames": frames(json!({"rotation": 0.01}))}),
        json!({
            "camera_angle_x": 0.75, "camera_angle_y": 1.2, "fl_x": 1375.5, "fl_y": 1374.5, "k1": 0.05, "k2": -0.08,
            "k3": 0, "k4": 0, "p1": -9e-4, "p2": 1e-4, "is_fisheye": false, "cx": 554.6, "cy": 965.3, "w": 1080.0,
            "h": 1920.0, "aabb_scale": 4, "scale": 0.3, "offset": [0.5, 0.5, 0.5],
            "frames": frames(json!({"sharpness": 31.7}))
        }),
        json!({
            "camera_model": "OPENCV_FISHEYE", "applied_transform": [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]],
            "applied_scale": 1.0, "ply_file_path": "sparse_pc.ply", "orientation_override": "none",
            "train_filenames": ["images/0000.png", "images/0001.png"], "val_filenames": [],
            "test_filenames": ["images/0003.png"],
            "frames": frames(json!({"fl_x": 500, "fl_y": 501, "cx": 320, "cy": 240, "w": 640, "h": 480, "k1": 0.1}))
        }),
        json!({
            "w": 640, "h": 480, "camera_model": "OPENCV",
            "frames": frames(json!({"intrinsics": {"fl_x": 300, "cx": 320, "cy": 240, "distortion_params": [0.1]}}))
        }),
        json!({"w": 64, "h": 48, "frames": frames(json!({"K": [[60, 0, 32], [0, 60, 24], [0, 0, 1]]}))}),
        json!({"latlong": true, "w": 64, "h": 32, "aabb": [[0, 0, 0], [1, 2, 3]], "frames": frames(json!({}))}),
        json!({"camera_model": "ORTHOPHOTO", "fl_x": 20.0, "frames": frames(json!({"cx": 3, "cy": 4}))}),
        json!({"x_fov": 40, "frames": {"a": frame(0, json!({})), "b": frame(1, json!({}))}}),
        json!({"fl_x": 9, "dist_coeffs": [0.1, 0.2, 0.3, 0.4, 0.5], "frames": frames(json!({})),
            "test_frames": frames(json!({"transform_matrix_start": pose(1.0), "transform_matrix_end": pose(2.0)}))}),
        json!([{"file_path": "a", "transform": pose(0.0), "fx": 3.0}]),
    ]
}

/// Values that a key does not expect.
pub(crate) fn odd_values() -> Vec<Value> {
    let nested = (0..100).fold(json!(1), |inner, _| json!([inner]));
    let flip = json!([[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]);
    vec![
        json!(null),
        json!(true),
        json!(false),
        json!(0),
        json!(-1),
        json!(0.5),
        json!(3.2),
        json!(1e12),
        json!(1e308),
        json!(-1e308),
        json!(1e-320),
        json!(u64::MAX),
        json!(""),
        json!("x"),
        json!("NaN"),
        json!("-inf"),
        json!("12"),
        json!("./images\\0001.png"),
        json!("OPENCV"),
        json!("FISHEYE"),
        json!("EQUIRECTANGULAR"),
        json!("FISHEYE624"),
        json!([]),
        json!({}),
        json!([1, 2, 3]),
        json!([[1], [2]]),
        json!([0.1, 0.2, 0.3, 0.4]),
        json!({"fl_x": 1}),
        flip,
        nested,
    ]
}

const KEYS: [&str; 30] = [
    "fl_x",
    "fl_y",
    "fx",
    "cx",
    "cy",
    "w",
    "h",
    "k1",
    "k3",
    "k6",
    "p1",
    "K",
    "intrinsics",
    "camera_angle_x",
    "camera_angle_y",
    "x_fov",
    "fovx",
    "camera_model",
    "is_fisheye",
    "latlong",
    "orthographic",
    "distortion_params",
    "dist_coeffs",
    "frames",
    "test_frames",
    "train_filenames",
    "file_path",
    "transform_matrix",
    "from_na",
    "aabb",
];

const TOKENS: [&str; 16] = [
    "NaN",
    "-Infinity",
    "1e999",
    "//",
    "/*",
    "*/",
    ",",
    ",,",
    "\"",
    "\\",
    "{",
    "}",
    "[",
    "]",
    "\u{feff}",
    "é\n",
];

#[derive(Clone, Debug)]
enum Damage {
    Replace { node: u16, value: u8 },
    Insert { node: u16, key: u8, value: u8 },
    Remove { node: u16 },
    Copy { from: u16, to: u16 },
}

#[derive(Clone, Debug)]
enum Noise {
    Set { at: u16, byte: u8 },
    Insert { at: u16, token: u8 },
    Remove { at: u16, length: u8 },
    Repeat { at: u16, length: u8, times: u8 },
    End { at: u16 },
}

/// A seed, damaged as a document, written, and damaged as bytes.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    seed: u8,
    damage: Vec<Damage>,
    noise: Vec<Noise>,
    as_utf16: bool,
}

pub(crate) fn cases() -> impl Strategy<Value = Case> {
    let damage = prop_oneof![
        (any::<u16>(), any::<u8>()).prop_map(|(node, value)| Damage::Replace { node, value }),
        (any::<u16>(), any::<u8>(), any::<u8>()).prop_map(|(node, key, value)| Damage::Insert {
            node,
            key,
            value
        }),
        any::<u16>().prop_map(|node| Damage::Remove { node }),
        (any::<u16>(), any::<u16>()).prop_map(|(from, to)| Damage::Copy { from, to }),
    ];
    let noise = prop_oneof![
        (any::<u16>(), any::<u8>()).prop_map(|(at, byte)| Noise::Set { at, byte }),
        (any::<u16>(), any::<u8>()).prop_map(|(at, token)| Noise::Insert { at, token }),
        (any::<u16>(), any::<u8>()).prop_map(|(at, length)| Noise::Remove { at, length }),
        (any::<u16>(), any::<u8>(), 1u8..20).prop_map(|(at, length, times)| Noise::Repeat {
            at,
            length,
            times
        }),
        any::<u16>().prop_map(|at| Noise::End { at }),
    ];
    // Half of the documents stay valid JSON, so that the keys are reached.
    let noise = prop_oneof![Just(Vec::new()), vec(noise, 1..4)];
    (any::<u8>(), vec(damage, 0..6), noise, prop::bool::weighted(0.05))
        .prop_map(|(seed, damage, noise, as_utf16)| Case { seed, damage, noise, as_utf16 })
}

fn nodes(value: &Value) -> usize {
    1 + match value {
        Value::Array(list) => list.iter().map(nodes).sum(),
        Value::Object(map) => map.values().map(nodes).sum(),
        _ => 0,
    }
}

/// The node of a number, counted in the order of the document.
fn node<'a>(value: &'a mut Value, index: &mut usize) -> Option<&'a mut Value> {
    if *index == 0 {
        return Some(value);
    }
    *index -= 1;
    match value {
        Value::Array(list) => list.iter_mut().find_map(|inner| node(inner, index)),
        Value::Object(map) => map.values_mut().find_map(|inner| node(inner, index)),
        _ => None,
    }
}

impl Damage {
    fn apply(&self, document: &mut Value, odd: &[Value]) {
        fn at(document: &mut Value, index: u16) -> Option<&mut Value> {
            let count = nodes(document);
            node(document, &mut (usize::from(index) % count))
        }
        match *self {
            Self::Replace { node, value } => {
                if let Some(node) = at(document, node) {
                    *node = odd[usize::from(value) % odd.len()].clone();
                }
            }
            Self::Insert { node, key, value } => {
                if let Some(Value::Object(map)) = at(document, node) {
                    let key = KEYS[usize::from(key) % KEYS.len()];
                    map.insert(key.to_owned(), odd[usize::from(value) % odd.len()].clone());
                }
            }
            Self::Remove { node } => match at(document, node) {
                Some(Value::Object(map)) => *map = std::mem::take(map).into_iter().skip(1).collect(),
                Some(Value::Array(list)) => drop(list.pop()),
                _ => {}
            },
            Self::Copy { from, to } => {
                let source = at(document, from).map(|node| node.clone());
                // A copy of the whole into itself would double the document each time.
                let source = source.filter(|source| nodes(source) < 200);
                if let (Some(source), Some(target)) = (source, at(document, to)) {
                    *target = source;
                }
            }
        }
    }
}

impl Noise {
    fn apply(&self, bytes: &mut Vec<u8>) {
        let (Self::Set { at, .. }
        | Self::Insert { at, .. }
        | Self::Remove { at, .. }
        | Self::Repeat { at, .. }
        | Self::End { at }) = *self;
        let at = usize::from(at) % bytes.len().max(1);
        let range = |length: u8| at..bytes.len().min(at + usize::from(length));
        match *self {
            Self::Set { byte, .. } => bytes[at..].iter_mut().take(1).for_each(|target| *target = byte),
            Self::Insert { token, .. } => {
                let token = TOKENS[usize::from(token) % TOKENS.len()];
                drop(bytes.splice(at..at, token.bytes()));
            }
            Self::Remove { length, .. } => drop(bytes.drain(range(length))),
            Self::Repeat { length, times, .. } => {
                let part = bytes[range(length)].repeat(usize::from(times));
                drop(bytes.splice(at..at, part));
            }
            Self::End { .. } => bytes.truncate(at),
        }
    }
}

impl Case {
    /// The damaged document.
    pub(crate) fn bytes(&self, seeds: &[Value], odd: &[Value]) -> Vec<u8> {
        let mut document = seeds[usize::from(self.seed) % seeds.len()].clone();
        for damage in &self.damage {
            damage.apply(&mut document, odd);
        }
        let mut bytes = document.to_string().into_bytes();
        for noise in &self.noise {
            noise.apply(&mut bytes);
        }
        match std::str::from_utf8(&bytes) {
            Ok(text) if self.as_utf16 => {
                std::iter::once(0xfeff).chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect()
            }
            _ => bytes,
        }
    }
}
