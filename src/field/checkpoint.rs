//! Checkpoints: a field, the state of its training, and everything needed to render it without its dataset.
//!
//! One safetensors file. Tensors: the parameters and Adam's moments (`table`: `[entries, 2]`,
//! `table_moments`: `[entries, 4]`, `mlp*`: `[quads, 4]`), `occupancy` (`[cascades, cells, cells, cells]`) and
//! `occupancy_bits`. The metadata entry [`KEY`] holds [`Metadata`] as JSON.

use crate::camera::Bounds;
use crate::camera::orbit::Orbit;
use crate::config::Config;
use crate::config::schedule::Budget;
use crate::field::parameters::{Array, Numbers};
use crate::field::state::State;
use crate::field::{Capabilities, Plan, SceneFeatures, Space};
use crate::photo::{Reading, Split};
use crate::support::file::write_atomically;
use crate::support::remedy::{Advised, Remedy};
use anyhow::{Context, Result, anyhow, bail, ensure};
use safetensors::tensor::{Dtype, SafeTensorError, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::HashMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The layout of the file that this version writes; it reads the one before, too.
pub const FORMAT: u64 = 3;
/// The oldest layout that is read. It had the number of cascades among the features, where it is the box's now.
const OLDEST_FORMAT: u64 = 2;
/// The key of the metadata entry.
pub const KEY: &str = "nerf";
/// The file's name in the folder of a training run.
pub const FILE: &str = "checkpoint.safetensors";

/// A trained field and where its training stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Where it comes from and how it is to be linked.
    pub metadata: Metadata,
    /// Parameters, moments and occupancy.
    pub state: State,
}

/// The metadata of a checkpoint: its configuration, progress, dataset and scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Metadata {
    /// Always [`FORMAT`].
    pub format: u64,
    /// The dataset as it was named.
    pub dataset: String,
    /// The adapter trained on.
    pub adapter: String,
    /// Steps taken.
    pub step: u32,
    /// Rays of the next step.
    pub rays: u32,
    /// By how much the steps along its rays are longer than the configuration's, as a share of them.
    #[serde(default)]
    pub step_excess: f32,
    /// Seconds of training; 0 of a deterministic run.
    pub seconds: f64,
    /// When the run is to end.
    pub budget: Budget,
    /// The resolved configuration; `grid.finest` is never 0.
    pub config: Arc<Config>,
    /// The scene's box in world space.
    pub bounds: Bounds,
    /// The scene's features, which the kernels were linked for.
    #[serde(rename = "needs")]
    pub features: SceneFeatures,
    /// How the photos were read.
    pub reading: Reading,
    /// Which frames were trained on, and which were not.
    pub splits: SplitNames,
    /// Median width and height of the training images, in pixels.
    pub image_size: [u32; 2],
    /// Whether the training images have transparent pixels.
    pub has_alpha: bool,
    /// The circle to see the scene from.
    pub orbit: Orbit,
}

/// Names of the frames of each split.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SplitNames {
    /// Trained on.
    pub train: Vec<String>,
    /// Set aside to choose settings by.
    pub val: Vec<String>,
    /// Measured on.
    pub test: Vec<String>,
}

impl SplitNames {
    /// The names of one split.
    #[must_use]
    pub fn names(&self, split: Split) -> &[String] {
        match split {
            Split::Train => &self.train,
            Split::Val => &self.val,
            Split::Test => &self.test,
        }
    }
}

/// Settings of earlier versions, which rendering does not need and training no longer knows.
const RETIRED: [(&str, &str); 5] = [
    ("/config/selection", "keep_probability"),
    ("/config/occupancy", "warm_up"),
    ("/config/occupancy", "stride"),
    ("/needs", "cascades"),
    ("/needs", "cameras"),
];

impl Metadata {
    /// How kernels are linked for an adapter.
    #[must_use]
    pub fn plan(&self, adapter: Capabilities) -> Plan {
        Plan::suited_to(adapter, Arc::clone(&self.config), self.features.clone(), Space::from(&self.bounds))
    }

    /// The arrays of the state, which are the same on every adapter.
    fn arrays(&self) -> impl Iterator<Item = Array> {
        let arrays: Vec<_> = self.plan(Capabilities::GPU).arrays().collect();
        arrays.into_iter()
    }

    fn parse(text: &str) -> Result<Self> {
        let mut value: Value = serde_json::from_str(text).context("its description is not JSON")?;
        match value["format"].as_u64() {
            Some(OLDEST_FORMAT..=FORMAT) => value["format"] = FORMAT.into(),
            Some(other) => {
                bail!(
                    "expected format {FORMAT}, found {other}: another version of nerf wrote it; render it \
                     with that version, or train again"
                )
            }
            None => bail!("its description has no format number"),
        }
        for (group, key) in RETIRED {
            if let Some(settings) = value.pointer_mut(group).and_then(Value::as_object_mut) {
                settings.remove(key);
            }
        }
        let metadata: Self = serde_json::from_value(value).context("its description is not understood")?;
        metadata.config.validate().context("its configuration")?;
        ensure!(metadata.config.grid.finest > 0, "its configuration leaves grid.finest open");
        let cascades = metadata.bounds.cascades;
        ensure!((1..=8).contains(&cascades), "expected 1 to 8 cascades, found {cascades}");
        ensure!(metadata.bounds.half.is_finite() && metadata.bounds.half > 0.0, "its scene box is empty");
        Ok(metadata)
    }
}

impl Checkpoint {
    /// Writes the file, or leaves the one that is there alone.
    ///
    /// # Errors
    /// When a number is not finite, or the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        let mut tensors = Vec::new();
        for (array, (name, numbers)) in self.metadata.arrays().zip(&self.state.arrays) {
            let (found, expected) = (numbers.count(), array.count());
            ensure!(
                *name == array.name && found == expected,
                "the tensor '{name}' has {found} numbers, and {expected} of '{}' are expected",
                array.name
            );
            check_finite(name, numbers.floats())?;
            let (dtype, bytes) = match numbers {
                Numbers::Floats(numbers) => (Dtype::F32, bytemuck::cast_slice(numbers)),
                Numbers::Words(numbers) => (Dtype::U32, bytemuck::cast_slice(numbers)),
            };
            tensors.push((*name, TensorView::new(dtype, array.shape, bytes)?));
        }
        let entries = HashMap::from([(KEY.to_owned(), serde_json::to_string(&self.metadata)?)]);
        let bytes = safetensors::serialize(tensors, Some(entries))?;
        write_atomically(path, |file| Ok(file.write_all(&bytes)?))
    }

    /// Reads the file and checks it against its own description.
    ///
    /// # Errors
    /// When it is missing, not a checkpoint, of another version, cut short or damaged.
    pub fn load(path: &Path) -> Result<Self> {
        let name = path.display();
        let bytes = std::fs::read(path).with_context(|| format!("reading the checkpoint {name}"))?;
        Self::parse(&bytes).with_context(|| format!("the checkpoint {name} cannot be used"))
    }

    fn parse(bytes: &[u8]) -> Result<Self> {
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(|error| explain(&error, bytes))?;
        let entry = header.metadata().as_ref().and_then(|entries| entries.get(KEY));
        let entry = entry.context("it is a safetensors file, but `nerf train` did not write it")?;
        let metadata = Metadata::parse(entry)?;
        let tensors = SafeTensors::deserialize(bytes)?;
        let numbers = |array: Array| {
            let Array { name, shape, .. } = &array;
            let dtype = if array.has_words() { Dtype::U32 } else { Dtype::F32 };
            let tensor = tensors.tensor(name).map_err(|_| anyhow!("the tensor '{name}' is missing"))?;
            ensure!(
                tensor.dtype() == dtype && tensor.shape() == shape,
                "the tensor '{name}' should be {dtype:?} {shape:?}, found {:?} {:?}",
                tensor.dtype(),
                tensor.shape()
            );
            let numbers = match dtype {
                Dtype::U32 => Numbers::Words(bytemuck::pod_collect_to_vec(tensor.data())),
                _ => Numbers::Floats(bytemuck::pod_collect_to_vec(tensor.data())),
            };
            check_finite(name, numbers.floats())?;
            Ok((array.name, numbers))
        };
        let arrays = metadata.arrays().map(numbers).collect::<Result<_>>()?;
        let state =
            State { step: metadata.step, rays: metadata.rays, step_excess: metadata.step_excess, arrays };
        Ok(Self { metadata, state })
    }
}

/// The checkpoint that a folder of a training run, or a path to the file itself, stands for.
///
/// # Errors
/// When there is none; the message says where it was looked for.
pub fn locate(path: &Path) -> Result<PathBuf> {
    if path.is_dir() {
        let file = path.join(FILE);
        let missing = || format!("the folder {} has no {FILE}; expected ", path.display());
        ensure!(file.is_file(), Advised::new(missing(), Remedy::RunFolder, ""));
        return Ok(file);
    }
    let missing = || format!("{} does not exist; expected ", path.display());
    ensure!(path.is_file(), Advised::new(missing(), Remedy::RunFolder, ", or a checkpoint in it"));
    Ok(path.to_owned())
}

fn explain(error: &SafeTensorError, bytes: &[u8]) -> anyhow::Error {
    let found = bytes.len();
    match error {
        SafeTensorError::HeaderTooSmall | SafeTensorError::MetadataIncompleteBuffer => {
            anyhow!(
                "it is cut short or damaged: found {found} bytes, and its header describes another length"
            )
        }
        SafeTensorError::InvalidHeaderLength if bytes.get(8) == Some(&b'{') => {
            anyhow!("it is cut short: found {found} bytes, not even its header")
        }
        other => {
            anyhow!("expected a safetensors file written by `nerf train`, found something else ({other})")
        }
    }
}

fn check_finite(name: &str, values: &[f32]) -> Result<()> {
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(index) => bail!(
            "the tensor '{name}' has a value that is not finite ({} at {index}): training diverged; \
             start again with a smaller optimizer.learning_rate",
            values[index]
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn checkpoint() -> Checkpoint {
        let mut config = Config::default();
        let small = r#"{"grid": {"levels": 8, "finest": 40, "log2_table": 8}, "occupancy": {"cells": 16}}"#;
        config.merge(&serde_json::from_str(small).expect("JSON")).expect("valid");
        let bounds = Bounds { center: DVec3::new(0.1, 0.2, 0.3), half: 1.5, cascades: 1, source: "x".into() };
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
            image_size: [30, 20],
            has_alpha: true,
            orbit: Orbit::of(&[], DVec3::ZERO),
        };
        let numbers = |array: Array| {
            let floats = (0..array.count()).map(|i| i as f32 * 0.25 - 3.0).collect();
            let words = array.has_words().then(|| Numbers::Words(vec![0xdead_beef; array.count()]));
            (array.name, words.unwrap_or(Numbers::Floats(floats)))
        };
        let state = State {
            step: 12,
            rays: 345,
            step_excess: 0.25,
            arrays: metadata.arrays().map(numbers).collect(),
        };
        Checkpoint { metadata, state }
    }

    fn saved() -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join(FILE);
        checkpoint().save(&path).expect("writable");
        (folder, path)
    }

    fn complaint(path: &Path) -> String {
        format!("{:#}", Checkpoint::load(path).expect_err("refused"))
    }

    #[test]
    fn what_is_saved_is_loaded() {
        let (folder, path) = saved();
        assert_eq!(Checkpoint::load(&path).expect("readable"), checkpoint());
        assert_eq!(locate(folder.path()).expect("there"), path);
        assert_eq!(locate(&path).expect("there"), path);
    }

    #[test]
    fn other_files_and_parts_of_one_are_refused() {
        let (folder, path) = saved();
        let bytes = std::fs::read(&path).expect("readable");
        for length in [0, 5, 100, bytes.len() / 2, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..length]).expect("writable");
            assert!(complaint(&path).contains("cut short"), "{length}: {}", complaint(&path));
        }
        std::fs::write(&path, "just some text that is no checkpoint").expect("writable");
        assert!(complaint(&path).contains("expected a safetensors file"), "{}", complaint(&path));
        std::fs::remove_file(&path).expect("removable");
        assert!(complaint(&path).contains("reading the checkpoint"));
        assert!(locate(folder.path()).is_err() && locate(&path).is_err());
    }

    #[test]
    fn settings_of_earlier_versions_are_left_out() {
        let metadata = checkpoint().metadata;
        let mut value = serde_json::to_value(&metadata).expect("JSON");
        assert!(value["needs"].is_object(), "the key of the scene's features in every file so far");
        value["format"] = OLDEST_FORMAT.into();
        for (group, key) in RETIRED {
            value.pointer_mut(group).expect("a group")[key] = 1.into();
        }
        assert_eq!(Metadata::parse(&value.to_string()).expect("known"), metadata);
        for group in ["/config/occupancy", "/needs"] {
            let mut unknown = value.clone();
            unknown.pointer_mut(group).expect("a group")["unheard_of"] = 1.into();
            assert!(Metadata::parse(&unknown.to_string()).is_err(), "{group}");
        }
    }

    #[test]
    fn another_version_or_size_is_refused() {
        let (_folder, path) = saved();
        let text = |metadata: &Metadata| serde_json::to_string(metadata).expect("JSON");
        let metadata = checkpoint().metadata;
        let newer = Metadata { format: FORMAT + 1, ..metadata.clone() };
        assert!(format!("{:#}", Metadata::parse(&text(&newer)).expect_err("newer")).contains("found 4"));
        let bytes = std::fs::read(&path).expect("readable");
        let (from, to) = (r#"\"log2_table\":8"#, r#"\"log2_table\":9"#);
        let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).expect("there");
        let mut other = bytes;
        other[at..at + to.len()].copy_from_slice(to.as_bytes());
        std::fs::write(&path, other).expect("writable");
        assert!(complaint(&path).contains("the tensor 'table' should be"), "{}", complaint(&path));
    }

    #[test]
    fn what_is_not_finite_is_neither_saved_nor_loaded() {
        let (_folder, path) = saved();
        let mut diverged = checkpoint();
        diverged.state.floats_mut("mlp")[7] = f32::NAN;
        let error = format!("{:#}", diverged.save(&path).expect_err("diverged"));
        assert!(error.contains("'mlp'") && error.contains("NaN at 7"), "{error}");
        let mut bytes = std::fs::read(&path).expect("readable");
        assert!(Checkpoint::parse(&bytes).is_ok(), "the good one is still there");
        let header = u64::from_le_bytes(*bytes.first_chunk().expect("a length")) as usize;
        bytes[8 + header..][..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
        std::fs::write(&path, bytes).expect("writable");
        assert!(complaint(&path).contains("not finite"), "{}", complaint(&path));
    }
}
