//! What a checkpoint says about itself.

use super::{FORMAT, OLDEST_FORMAT, OtherVersion};
use crate::camera::orbit::Orbit;
use crate::camera::{Bounds, Camera};
use crate::config::Config;
use crate::config::schedule::Budget;
use crate::field::parameters::Array;
use crate::field::{Capabilities, Plan, SceneFeatures, Space};
use crate::photo::{Reading, Split};
use anyhow::{Context, Result, bail, ensure};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::f64::consts::FRAC_PI_2;
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::sync::Arc;

/// Most steps of a run.
const MOST_STEPS: u32 = 1 << 31;
/// The largest `march.longest_step`.
const LONGEST_STEP: f64 = 64.0;
/// Longest side of an image, in pixels.
const LONGEST_SIDE: u32 = 1 << 24;
/// Largest coordinate in world units, or focal length in pixels: single precision holds its square.
const FARTHEST: f64 = 1e15;

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
    /// What those frames were; `None` in files from before it was kept.
    #[serde(default)]
    pub contents: Option<FrameContents>,
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

/// What frames were, by which their dataset is known whatever it is called: in the order of [`SplitNames::all`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameContents {
    /// Cameras, at the size of the photos.
    pub cameras: Vec<Camera>,
    /// [Fingerprints](crate::support::fingerprint::fingerprint) of the image files.
    pub photos: Vec<u32>,
}

impl SplitNames {
    /// Those of all splits, one after the other.
    pub fn all(&self) -> impl Iterator<Item = &String> {
        self.train.iter().chain(&self.val).chain(&self.test)
    }

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
pub(super) const RETIRED: [(&str, &str); 5] = [
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
    pub(super) fn arrays(&self) -> impl Iterator<Item = Array> {
        let arrays: Vec<_> = self.plan(Capabilities::GPU).arrays().collect();
        arrays.into_iter()
    }

    /// Parses the JSON of a file that has checksums or has none.
    pub(super) fn parse(text: &str, has_checksums: bool) -> Result<Self> {
        let mut value: Value = serde_json::from_str(text).context("its description is not JSON")?;
        match value["format"].as_u64() {
            Some(FORMAT) => ensure!(has_checksums, "its header is damaged: it lists no checksums"),
            Some(OLDEST_FORMAT..FORMAT) => value["format"] = FORMAT.into(),
            Some(found) => return Err(OtherVersion { found }.into()),
            None => bail!("its description has no format number"),
        }
        for (group, key) in RETIRED {
            if let Some(settings) = value.pointer_mut(group).and_then(Value::as_object_mut) {
                settings.remove(key);
            }
        }
        let metadata: Self = serde_json::from_value(value).context("its description is not understood")?;
        metadata.validate().context("its description")?;
        Ok(metadata)
    }

    /// Checks every range: nothing in it may be endless, enormous or not a number.
    ///
    /// # Errors
    /// Names what is out of range, what is allowed and what was found.
    pub fn validate(&self) -> Result<()> {
        let Self { config, bounds, features, reading, orbit, .. } = self;
        config.validate().context("its configuration")?;
        self.budget.validate().context("its budget")?;
        within("grid.finest", config.grid.finest, 1..=u32::MAX)?;
        within("step", self.step, 0..=MOST_STEPS)?;
        within("rays", self.rays as usize, 1..=config.batch.rays)?;
        within("step_excess", f64::from(self.step_excess), 0.0..=LONGEST_STEP - 1.0)?;
        within("seconds", self.seconds, 0.0..=f64::MAX)?;
        within("bounds.cascades", bounds.cascades, 1..=8)?;
        within("bounds.half", bounds.half, 1.0 / FARTHEST..=FARTHEST)?;
        within("needs.grey", features.grey, SceneFeatures::GREY)?;
        ensure!(!features.lenses.is_empty(), "needs.lenses is empty");
        if let Some(FrameContents { cameras, photos }) = &self.contents {
            let count = self.splits.all().count();
            let is_whole = cameras.len() == count && photos.len() == count;
            ensure!(
                is_whole,
                "contents must be of {count} frames; found {} and {}",
                cameras.len(),
                photos.len()
            );
        }
        within("reading.downscale", reading.downscale, 1..=u32::MAX)?;
        within("reading.max_images", reading.max_images.unwrap_or(1), 1..=usize::MAX)?;
        for side in [self.image_size[0], self.image_size[1], orbit.width, orbit.height] {
            within("a side of an image", side, 1..=LONGEST_SIDE)?;
        }
        within("orbit.focal_px", orbit.focal_px, 1e-9..=FARTHEST)?;
        within("orbit.radius", orbit.radius, f64::MIN_POSITIVE..=FARTHEST)?;
        within("orbit.elevation_rad", orbit.elevation_rad, -FRAC_PI_2..=FRAC_PI_2)?;
        within("the length of orbit.up", orbit.up.length(), 0.999..=1.001)?;
        let places = bounds.center.to_array();
        places.iter().try_for_each(|&place| within("bounds.center", place, -FARTHEST..=FARTHEST))
    }
}

fn within<T: PartialOrd + Display>(what: &str, found: T, range: RangeInclusive<T>) -> Result<()> {
    let (low, high) = (range.start(), range.end());
    ensure!(range.contains(&found), "{what} must lie between {low} and {high}; found {found}");
    Ok(())
}
