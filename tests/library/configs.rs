//! The files in `configs/`.

use nerf::config::Config;
use serde_json::Value;
use std::path::{Path, PathBuf};

fn presets() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let entries = std::fs::read_dir(folder).expect("the folder of presets");
    entries.map(|entry| entry.expect("an entry").path()).collect()
}

#[test]
fn every_preset_is_valid() {
    assert!(presets().len() >= 3);
    for path in presets() {
        let mut config = Config::default();
        config.merge_file(&path).expect("a preset");
        config.validate().unwrap_or_else(|error| panic!("{}: {error:#}", path.display()));
    }
}

#[test]
fn the_base_preset_spells_out_the_defaults() {
    let path = presets().into_iter().find(|path| path.ends_with("base.json")).expect("base.json");
    let text = std::fs::read_to_string(path).expect("readable");
    let base: Value = serde_json::from_str(&text).expect("JSON");
    let defaults = serde_json::to_value(Config::default()).expect("serialises");
    assert_eq!(base, defaults, "configs/base.json must hold every key with its default");
}

/// Captures have losses of their own on every adapter, and software adapters sizes of their own in every scene.
#[test]
fn presets_are_laid_over_one_another() {
    let preset = |is_cpu, is_capture| Config::preset(is_cpu, is_capture).expect("compiled in");
    assert_eq!(preset(false, false), Config::default());
    for is_cpu in [false, true] {
        let (object, capture) = (preset(is_cpu, false), preset(is_cpu, true));
        assert_eq!([object.loss.distortion, object.loss.sparsity], [0.0; 2]);
        assert!(capture.loss.distortion > 0.0 && capture.loss.sparsity > 0.0);
        assert_eq!((object.batch, object.grid), (capture.batch, capture.grid));
        assert_eq!(object.march == capture.march, !is_cpu);
    }
    assert!(preset(true, false).batch.kept < preset(false, false).batch.kept);
}

#[test]
fn numbers_may_be_written_as_people_do() {
    let set = |assignment: &str| {
        let mut config = Config::default();
        config.set(assignment).map(|()| config.loss.distortion)
    };
    for assignment in ["loss.distortion=.005", "loss.distortion=5e-3", "loss.distortion=+0.005"] {
        assert_eq!(set(assignment).expect("a number"), 0.005, "{assignment}");
    }
    for assignment in
        ["loss.distortion=inf", "loss.distortion=NaN", "loss.distortion=much", "loss.distortion="]
    {
        let error = format!("{:#}", set(assignment).expect_err("no number"));
        assert!(error.contains("expected f64"), "{error}");
    }
}
