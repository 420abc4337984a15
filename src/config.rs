//! Every number that shapes a training run, with its default; read from JSON, stored in the checkpoint.

mod ranges;
pub mod schedule;

use crate::support::remedy::{Advised, Remedy};
use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};
use serde_json::{Number, Value};
use std::path::Path;

/// The whole configuration. `Config::default()` suits objects on a GPU; [`Config::preset`] knows the others.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The multiresolution hash grid.
    pub grid: Grid,
    /// The two networks.
    pub network: Network,
    /// Steps along the rays.
    pub march: March,
    /// The occupancy grid.
    pub occupancy: Occupancy,
    /// Rays and samples per step.
    pub batch: Batch,
    /// Which samples get colour and gradients.
    pub selection: Selection,
    /// What is minimised.
    pub loss: Loss,
    /// Adam and the learning-rate schedule.
    pub optimizer: Optimizer,
    /// What lies behind the scene while training.
    pub background: Background,
    /// Whether T_i holds what lies before sample i (exclusive) or sample i too (inclusive, as the derivation prints it).
    pub transmittance: Transmittance,
    /// How gradients of the table are summed; `auto` chooses by adapter.
    pub accumulation: Accumulation,
    /// The same checkpoint bit for bit from the same adapter, program, seed and number of steps: gradients are
    /// summed in an order, or as integers, and no time of day or duration is stored.
    pub deterministic: bool,
    /// Seed of every random number.
    pub seed: u32,
}

/// The multiresolution hash grid (Müller et al. 2022).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Grid {
    /// Number of levels, a multiple of 8 up to 32; two features each.
    pub levels: usize,
    /// Cells per axis of the coarsest level.
    pub base: u32,
    /// Cells per axis of the finest level; 0 follows the pixel footprint of the training views.
    pub finest: u32,
    /// Binary logarithm of the largest number of entries per level, 8 to 24.
    pub log2_table: u32,
}

/// The density and the colour network: no biases, ReLU.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Network {
    /// Width of the hidden layers, a multiple of 16 up to 128.
    pub width: usize,
    /// Hidden layers of the colour network, 1 to 4. The density network has one.
    pub color_layers: usize,
}

/// Steps along the rays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct March {
    /// Smallest steps along the diagonal of the inner cube.
    pub steps: u32,
    /// Steps are longer than that while rays have more samples than this on average: as long as fog fills the way, many
    /// rays teach more than many samples.
    pub samples_per_ray: f64,
    /// How many times longer at most, and at the start.
    pub longest_step: f64,
    /// Growth of the step with the distance, in boxes larger than the inner cube.
    pub cone: f64,
    /// Most steps along one ray, a multiple of 32.
    pub most_steps: usize,
    /// Nothing is sampled nearer to the camera than this, in inner cubes.
    pub near: f64,
}

/// The occupancy grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Occupancy {
    /// Cells per axis of each cascade, a multiple of 16 up to 256.
    pub cells: u32,
    /// Factor on every cell's value at each update: what rays and visits do not raise again fades.
    pub decay: f64,
    /// A cell is occupied above this optical depth per smallest step (or half the mean, if that is less).
    pub threshold: f64,
    /// Steps between updates.
    pub interval: u32,
    /// Cells that updates visit, as a share of the samples that rays march: rays refresh the cells they go through.
    pub share: f64,
}

/// Rays and samples per step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Batch {
    /// Samples with colour and gradients per step; the number of rays follows.
    pub kept: usize,
    /// Most samples marched per step.
    pub samples: usize,
    /// Most rays per step.
    pub rays: usize,
    /// Rays of the first step.
    pub first_rays: u32,
}

/// Which marched samples get colour and gradients.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Selection {
    /// Samples of at least this weight are kept; lighter ones form groups of about twice that, of which one stands for
    /// all in each of two estimates. 0 keeps every sample.
    pub weight_floor: f64,
    /// A group whose weight stays below this share of the floor is kept with a probability in proportion to its weight.
    pub light_share: f64,
    /// A ray ends where its transmittance falls below this.
    pub stop_transmittance: f64,
}

/// What is minimised, beside the squared error of the opacity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Loss {
    /// How errors of the colour count.
    pub color: ColorLoss,
    /// Weight of the squared error of the depth, in sides of the inner cube, where photos have depth; 0 leaves depth
    /// out.
    pub depth: f64,
    /// Weight of the distortion (Barron et al. 2022), which pulls the weights along a ray together; 0 leaves it out.
    pub distortion: f64,
    /// Weight of the sparsity, which clears what surfaces hide; 0 leaves it out.
    pub sparsity: f64,
}

/// How errors of the colour count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ColorLoss {
    /// Relative for HDR images, else squared.
    #[default]
    Auto,
    /// The squared error.
    Squared,
    /// The squared error over the rendered colour times the brighter of it and the photo's.
    Relative,
}

/// Adam and the learning-rate schedule: a cosine over the budget of time or steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Optimizer {
    /// Learning rate at the start.
    pub learning_rate: f64,
    /// Learning rate at the end of the budget.
    pub final_learning_rate: f64,
    /// Decay of the first moment.
    pub beta_1: f64,
    /// Decay of the second moment.
    pub beta_2: f64,
    /// Added to the root of the second moment.
    pub epsilon: f64,
    /// L2 regularisation of the networks' weights; the table has none.
    pub l2: f64,
}

/// What lies behind the scene while training.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Background {
    /// Black: the opacity channel alone carries the alpha.
    #[default]
    Black,
    /// White.
    White,
    /// Another colour for every ray and step.
    Random,
    /// One colour, in the field's colour space.
    Color([f32; 3]),
}

/// Which optical depths the transmittance `T_i` of a sample sums up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Transmittance {
    /// `T_i = exp(−Σ_{j<i} τ_j)`, the light that reaches the sample (Mildenhall et al. 2020, eq. 3).
    #[default]
    Exclusive,
    /// `T_i = exp(−Σ_{j≤i} τ_j)`, the light that leaves the sample, as Perlman 2023 prints it.
    Inclusive,
}

/// How the gradients of the table are summed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Accumulation {
    /// Ordered on CPU adapters; elsewhere long or fixed where the run is deterministic, else float atomics, else
    /// compare-exchange where there are none.
    #[default]
    Auto,
    /// One thread per level adds in the order of the samples: no atomics, and every run gives the same sum. On a CPU
    /// adapter, batches beyond 43,690 kept samples take long or fixed instead.
    Ordered,
    /// 64-bit integers, each in two 32-bit atomics: independent of order.
    Fixed,
    /// The same sums, by one 64-bit atomic each.
    Long,
    /// Float atomics.
    Float,
    /// Compare-exchange on the bits.
    Exchange,
}

impl Accumulation {
    /// Whether gradients are summed as 64-bit integers.
    #[must_use]
    pub fn is_of_integers(self) -> bool {
        matches!(self, Self::Fixed | Self::Long)
    }
}

impl Default for Grid {
    fn default() -> Self {
        Self { levels: 16, base: 16, finest: 0, log2_table: 19 }
    }
}

impl Default for Network {
    fn default() -> Self {
        Self { width: 64, color_layers: 2 }
    }
}

impl Default for March {
    fn default() -> Self {
        Self {
            steps: 1024,
            samples_per_ray: 128.0,
            longest_step: 16.0,
            cone: 1.0 / 256.0,
            most_steps: 1024,
            near: 0.05,
        }
    }
}

impl Default for Occupancy {
    fn default() -> Self {
        Self { cells: 128, decay: 0.95, threshold: 0.01, interval: 16, share: 0.1 }
    }
}

impl Default for Batch {
    fn default() -> Self {
        Self { kept: 1 << 17, samples: 1 << 19, rays: 1 << 17, first_rays: 4096 }
    }
}

impl Default for Selection {
    fn default() -> Self {
        Self { weight_floor: 5e-3, light_share: 0.125, stop_transmittance: 1e-4 }
    }
}

impl Default for Optimizer {
    fn default() -> Self {
        Self {
            learning_rate: 2e-2,
            final_learning_rate: 1e-4,
            beta_1: 0.9,
            beta_2: 0.99,
            epsilon: 1e-15,
            l2: 1e-6,
        }
    }
}

const CAPTURE_PRESET: &str = include_str!("../configs/capture.json");
const CPU_PRESET: &str = include_str!("../configs/cpu.json");
const CPU_CAPTURE_PRESET: &str = include_str!("../configs/cpu_capture.json");

impl Config {
    /// The defaults for an adapter and a scene. A capture, whose box is larger than the inner cube, has losses that keep
    /// its surfaces in place; a software adapter has a smaller table, batch and network, and longer steps in a capture.
    ///
    /// # Errors
    /// Never for the presets that are compiled in, which the tests read.
    pub fn preset(is_cpu: bool, is_capture: bool) -> Result<Self> {
        let mut config = Self::default();
        let presets =
            [(is_capture, CAPTURE_PRESET), (is_cpu, CPU_PRESET), (is_cpu && is_capture, CPU_CAPTURE_PRESET)];
        for (_, preset) in presets.into_iter().filter(|(is_used, _)| *is_used) {
            let changes = serde_json::from_str(preset).context("reading a preset")?;
            config.merge(&changes)?;
        }
        Ok(config)
    }

    /// Overrides what `changes`, a JSON object of the same shape, mentions.
    ///
    /// # Errors
    /// On an unknown key or a value of the wrong type.
    pub fn merge(&mut self, changes: &Value) -> Result<()> {
        let mut all = serde_json::to_value(&*self)?;
        overlay(&mut all, changes);
        *self = serde_json::from_value(all)?;
        Ok(())
    }

    /// Overrides from the JSON file at `path`.
    ///
    /// # Errors
    /// When it cannot be read, is not JSON, or does not fit; the message names the file.
    pub fn merge_file(&mut self, path: &Path) -> Result<()> {
        let name = path.display();
        let text = std::fs::read_to_string(path).with_context(|| format!("reading the config {name}"))?;
        let changes =
            serde_json::from_str(&text).with_context(|| format!("the config {name} is not JSON"))?;
        self.merge(&changes).with_context(|| format!("in the config {name}"))
    }

    /// Overrides one value, written `key.path=value`; the value is JSON, or else a string.
    ///
    /// # Errors
    /// When there is no `=`, no such key, or the value does not fit.
    pub fn set(&mut self, assignment: &str) -> Result<()> {
        let Some((path, text)) = assignment.split_once('=') else {
            let expected =
                format!(" expects key.path=value, for example grid.levels=8; found '{assignment}'");
            bail!(Advised::new("", Remedy::Setting, expected));
        };
        // People write .005, which JSON does not know.
        let number = || text.parse().ok().and_then(Number::from_f64).map(Value::Number);
        let mut change =
            serde_json::from_str(text).ok().or_else(number).unwrap_or_else(|| Value::String(text.to_owned()));
        for key in path.rsplit('.') {
            change = Value::Object([(key.to_owned(), change)].into_iter().collect());
        }
        self.merge(&change).with_context(|| Advised::new("in ", Remedy::Setting, format!(" {assignment}")))
    }
}

impl Background {
    /// The colour behind the scene; black where it changes from ray to ray.
    #[must_use]
    pub fn solid(self) -> [f32; 3] {
        match self {
            Self::Black | Self::Random => [0.0; 3],
            Self::White => [1.0; 3],
            Self::Color(color) => color,
        }
    }
}

/// Replaces in `target` what `changes` mentions, object by object.
fn overlay(target: &mut Value, changes: &Value) {
    match (target, changes) {
        (Value::Object(target), Value::Object(changes)) => {
            for (key, change) in changes {
                overlay(target.entry(key.clone()).or_insert(Value::Null), change);
            }
        }
        (target, changes) => *target = changes.clone(),
    }
}
