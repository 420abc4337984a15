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
