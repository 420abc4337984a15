use super::*;
use crate::camera::Bounds;
use crate::camera::orbit::Orbit;
use crate::config::Config;
use crate::config::schedule::Budget;
use crate::field::SceneFeatures;
use crate::field::parameters::Numbers;
use crate::photo::Reading;
use glam::DVec3;
use safetensors::SafeTensors;
use safetensors::tensor::TensorView;
use serde_json::{Value, json};
use std::io::Cursor;
use std::path::PathBuf;

pub(super) fn checkpoint() -> Checkpoint {
    let mut config = Config::default();
    let small = r#"{"grid": {"levels": 8, "finest": 40, "log2_table": 8}, "occupancy": {"cells": 16}}"#;
    config.merge(&serde_json::from_str(small).expect("JSON")).expect("valid");
    let bounds = Bounds {
        center: DVec3::new(0.1, 0.2, 0.3),
        half: 1.5,
        cascades: 1,
        source: "x".into(),
        is_guess: false,
    };
    let features = SceneFeatures { alpha: true, ..SceneFeatures::default() };
    let metadata = Metadata {
        format: FORMAT,
        dataset: "data/toys".into(),
        adapter: "a test".into(),
        step: 12,
        rays: 345,
        step_excess: 0.25,
        seconds: 6.75,
        budget: Budget { steps: Some(100), seconds: None },
        config: config.into(),
        bounds,
        features,
        reading: Reading { downscale: 2, ..Reading::default() },
        splits: SplitNames { train: vec!["a".into()], ..SplitNames::default() },
        contents: Some(FrameContents {
            cameras: Orbit::of(&[], DVec3::ZERO).cameras(DVec3::ZERO, 1),
            photos: vec![7],
        }),
        image_size: [30, 20],
        has_alpha: true,
        orbit: Orbit::of(&[], DVec3::ZERO),
    };
    let numbers = |array: Array| {
        let floats = (0..array.count()).map(|i| i as f32 * 0.25 - 3.0).collect();
        let words = array.has_words().then(|| Numbers::Words(vec![0xdead_beef; array.count()]));
        (array.name, words.unwrap_or(Numbers::Floats(floats)))
    };
    let state =
        State { step: 12, rays: 345, step_excess: 0.25, arrays: metadata.arrays().map(numbers).collect() };
    Checkpoint { metadata, state }
}

fn saved() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join(FILE);
    checkpoint().save(&path).expect("writable");
    (folder, path)
}

fn bytes() -> Vec<u8> {
    let (_folder, path) = saved();
    std::fs::read(path).expect("readable")
}

fn complaint(bytes: &[u8]) -> String {
    format!("{:#}", Checkpoint::read(Cursor::new(bytes)).expect_err("refused"))
}

/// Where the numbers begin.
fn data(bytes: &[u8]) -> usize {
    8 + u64::from_le_bytes(*bytes.first_chunk().expect("a length")) as usize
}

/// The bytes with the checksum that their header asks for.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let (header, end) = (crc32fast::hash(&bytes[..data(&bytes)]), bytes.len() - 4);
    bytes[end..].copy_from_slice(&header.to_le_bytes());
    bytes
}

/// A sound file that says something else of itself.
fn saying(change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let bytes = bytes();
    let mut header: Value = serde_json::from_slice(&bytes[8..data(&bytes)]).expect("JSON");
    let text = header["__metadata__"][KEY].as_str().expect("a description");
    let mut description: Value = serde_json::from_str(text).expect("JSON");
    change(&mut description);
    header["__metadata__"][KEY] = description.to_string().into();
    let mut text = header.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(8), b' ');
    let parts = [&(text.len() as u64).to_le_bytes()[..], &text, &bytes[data(&bytes)..]];
    sealed(parts.concat())
}

#[test]
fn what_is_saved_is_loaded() {
    let (folder, path) = saved();
    assert_eq!(Checkpoint::load(&path).expect("readable"), checkpoint());
    assert_eq!(locate(folder.path()).expect("there"), path);
    assert_eq!(locate(&path).expect("there"), path);
    let bytes = std::fs::read(&path).expect("readable");
    let others = SafeTensors::deserialize(&bytes).expect("a safetensors file");
    let checksums = others.tensor(CHECKSUMS).expect("the last one");
    assert_eq!(checksums.shape(), [others.len()]);
    assert_eq!(sealed(bytes.clone()), bytes);
}

#[test]
fn other_files_and_parts_of_one_are_refused() {
    let (folder, path) = saved();
    let bytes = std::fs::read(&path).expect("readable");
    for length in [0, 5, 8, 20, 100, bytes.len() / 2, bytes.len() - 1] {
        let complaint = complaint(&bytes[..length]);
        assert!(complaint.contains("cut short"), "{length}: {complaint}");
    }
    let complaint = complaint(b"just some text that is no checkpoint");
    assert!(complaint.contains("expected a safetensors file"), "{complaint}");
    std::fs::remove_file(&path).expect("removable");
    let missing = format!("{:#}", Checkpoint::load(&path).expect_err("missing"));
    assert!(missing.contains("reading the checkpoint"), "{missing}");
    assert!(locate(folder.path()).is_err() && locate(&path).is_err());
}

#[test]
fn a_flipped_bit_anywhere_is_refused() {
    let mut bytes = bytes();
    let data = data(&bytes);
    for bit in 0..8 * data {
        bytes[bit / 8] ^= 1 << (bit % 8);
        complaint(&bytes);
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
    let end = bytes.len();
    for (name, at) in [("the tensor 'table'", data), ("its header", end - 1)] {
        for bit in 0..8 {
            bytes[at] ^= 1 << bit;
            let complaint = complaint(&bytes);
            assert!(complaint.contains(name) && complaint.contains("damaged"), "{complaint}");
            bytes[at] ^= 1 << bit;
        }
    }
    for place in 0..400 {
        let at = data + place * 7919 % (end - data);
        bytes[at] ^= 1 << (place % 8);
        assert!(complaint(&bytes).contains("damaged"), "at {at}");
        bytes[at] ^= 1 << (place % 8);
    }
    assert!(Checkpoint::read(Cursor::new(&bytes)).is_ok(), "undamaged again");
}

#[test]
fn a_page_of_zeros_is_refused() {
    let bytes = bytes();
    for at in (0..bytes.len()).step_by(4096) {
        let mut damaged = bytes.clone();
        let page = at..bytes.len().min(at + 4096);
        damaged[page].fill(0);
        assert!(complaint(&damaged).contains("damaged"), "at {at}: {}", complaint(&damaged));
    }
}

#[test]
fn earlier_formats_are_read() {
    let checkpoint = checkpoint();
    let arrays: Vec<_> = checkpoint.metadata.arrays().collect();
    let tensors = arrays.iter().zip(&checkpoint.state.arrays).map(|(array, (name, numbers))| {
        let (dtype, bytes) = match numbers {
            Numbers::Floats(numbers) => (safetensors::Dtype::F32, bytemuck::cast_slice(numbers)),
            Numbers::Words(numbers) => (safetensors::Dtype::U32, bytemuck::cast_slice(numbers)),
        };
        (*name, TensorView::new(dtype, array.shape.clone(), bytes).expect("fits"))
    });
    let mut description = serde_json::to_value(&checkpoint.metadata).expect("JSON");
    description["format"] = OLDEST_FORMAT.into();
    let entries = [(KEY.to_owned(), description.to_string())].into();
    let earlier = safetensors::serialize(tensors, Some(entries)).expect("fits");
    assert_eq!(Checkpoint::read(Cursor::new(&earlier)).expect("known"), checkpoint);
}

#[test]
fn settings_of_earlier_versions_are_left_out() {
    let metadata = checkpoint().metadata;
    let mut value = serde_json::to_value(&metadata).expect("JSON");
    assert!(value["needs"].is_object(), "the key of the scene's features in every file so far");
    value["format"] = OLDEST_FORMAT.into();
    for (group, key) in metadata::RETIRED {
        value.pointer_mut(group).expect("a group")[key] = 1.into();
    }
    assert_eq!(Metadata::parse(&value.to_string(), false).expect("known"), metadata);
    for group in ["/config/occupancy", "/needs"] {
        let mut unknown = value.clone();
        unknown.pointer_mut(group).expect("a group")["unheard_of"] = 1.into();
        assert!(Metadata::parse(&unknown.to_string(), false).is_err(), "{group}");
    }
}

#[test]
fn another_version_or_size_is_refused() {
    let newer = Checkpoint::read(Cursor::new(saying(|text| text["format"] = (FORMAT + 1).into())));
    let error = newer.expect_err("newer");
    assert_eq!(error.downcast_ref(), Some(&OtherVersion { found: FORMAT + 1 }));
    assert!(error.to_string().contains("found 5"), "{error}");
    let larger = saying(|text| text["config"]["grid"]["log2_table"] = 9.into());
    assert!(complaint(&larger).contains("the tensor 'table' should be"), "{}", complaint(&larger));
}

#[test]
fn what_is_not_finite_is_neither_saved_nor_loaded() {
    let (_folder, path) = saved();
    let mut diverged = checkpoint();
    diverged.state.floats_mut("mlp")[7] = f32::NAN;
    let error = format!("{:#}", diverged.save(&path).expect_err("diverged"));
    assert!(error.contains("'mlp'") && error.contains("NaN at 7"), "{error}");
    assert!(Checkpoint::load(&path).is_ok(), "the good one is still there");
    let mut bytes = std::fs::read(&path).expect("readable");
    let (at, entries) = (data(&bytes), checkpoint().state.arrays[0].1.count());
    bytes[at..][..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let checksum = crc32fast::hash(&bytes[at..][..4 * entries]);
    let place = bytes.len() - 4 * (checkpoint().state.arrays.len() + 1);
    bytes[place..][..4].copy_from_slice(&checksum.to_le_bytes());
    assert!(complaint(&bytes).contains("not finite"), "{}", complaint(&bytes));
}

/// What is sound as a file, and would hang, panic or take all memory were it believed.
#[test]
fn impossible_descriptions_are_refused() {
    for (place, value) in [
        ("/step", json!(u32::MAX)),
        ("/rays", json!(0)),
        ("/rays", json!(u32::MAX)),
        ("/step_excess", json!(1e30)),
        ("/step_excess", json!(1e300)),
        ("/seconds", json!(-1.0)),
        ("/budget", json!({ "steps": null, "seconds": null })),
        ("/config/grid/finest", json!(0)),
        ("/config/march/steps", json!(1 << 30)),
        ("/config/batch/rays", json!(u32::MAX)),
        ("/config/background", json!({ "color": [1e300, 0.0, 0.0] })),
        ("/bounds/half", json!(0.0)),
        ("/bounds/half", json!(1e300)),
        ("/bounds/center", json!([0.0, 1e300, 0.0])),
        ("/bounds/cascades", json!(0)),
        ("/bounds/cascades", json!(33)),
        ("/needs/grey", json!(0.0)),
        ("/needs/grey", json!(1e300)),
        ("/needs/lenses", json!([])),
        ("/reading/downscale", json!(0)),
        ("/contents/photos", json!([])),
        ("/image_size", json!([0, 20])),
        ("/orbit/width", json!(u32::MAX)),
        ("/orbit/focal_px", json!(0.0)),
        ("/orbit/up", json!([0.0, 0.0, 0.0])),
        ("/orbit/radius", json!(-1.0)),
        ("/orbit/elevation_rad", json!(1e9)),
    ] {
        let bytes = saying(|text| *text.pointer_mut(place).expect(place) = value.clone());
        let complaint = complaint(&bytes);
        let key = place.rsplit('/').next().unwrap_or_default();
        let names = [key, "contents", "steps or seconds", "side of an image", "not understood", "shape"];
        assert!(names.iter().any(|name| complaint.contains(name)), "{place} {value}: {complaint}");
    }
}

/// Every place of JSON, as a pointer to it.
fn places(value: &Value, at: &str, found: &mut Vec<String>) {
    found.push(at.to_owned());
    match value {
        Value::Object(map) => {
            map.iter().for_each(|(key, inner)| places(inner, &format!("{at}/{key}"), found));
        }
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(index, inner)| places(inner, &format!("{at}/{index}"), found));
        }
        _ => {}
    }
}

/// Odd values at every place, in files with and without checksums: what is believed can be used.
#[test]
fn odd_descriptions_are_refused_or_can_be_used() {
    let odd = [
        json!(null),
        json!(true),
        json!(-1),
        json!(0),
        json!(1),
        json!(3),
        json!(0.5),
        json!(u32::MAX),
        json!(u64::MAX),
        json!(1e300),
        json!(-1e300),
        json!(1e-300),
        json!(1e-45),
        json!(""),
        json!("x"),
        json!("random"),
        json!([]),
        json!({}),
        json!([0.0, 0.0, 0.0]),
        json!([1e38, -1e38, 1e38]),
    ];
    let sound = serde_json::to_value(checkpoint().metadata).expect("JSON");
    let mut all = Vec::new();
    places(&sound, "", &mut all);
    let mut believed = 0;
    for (place, value) in all.iter().flat_map(|place| odd.iter().map(move |value| (place, value))) {
        for format in OLDEST_FORMAT..=FORMAT {
            let mut changed = sound.clone();
            changed["format"] = format.into();
            *changed.pointer_mut(place).expect("there") = value.clone();
            let Ok(metadata) = Metadata::parse(&changed.to_string(), format == FORMAT) else { continue };
            believed += 1;
            let show = format!("{value} at {place}");
            assert!(metadata.arrays().map(|array| array.count()).sum::<usize>() < 1 << 33, "{show}");
            for camera in metadata.orbit.cameras(metadata.bounds.center, 3) {
                let ray = camera.ray(glam::DVec2::ZERO).expect("a pinhole");
                assert!(ray.origin.is_finite() && ray.direction.is_finite(), "{show}");
            }
            let plan = metadata.plan(crate::field::Capabilities::GPU);
            let constants = format!("{:?}", plan.constants(crate::gpu::source::Source::new("a kernel")));
            assert!(!constants.contains("inf") && !constants.contains("NaN"), "{show}: {constants}");
            assert!(plan.step_range()[0] > 1e-9, "{show}");
        }
    }
    assert!((500..20 * all.len()).contains(&believed), "{believed} of {} places", all.len());
}
