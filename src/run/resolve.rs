//! What is trained, on what, and for how long: options, a dataset, an adapter and an earlier run together.

use super::contents::Differences;
use super::evaluate::Evaluator;
use super::event::{Event, Observer, Warning};
use super::memory::MemoryUse;
use super::options::TrainOptions;
use super::scene_features::NO_FRAME;
use super::settings::Settings;
use super::training_photos::TrainingPhotos;
use crate::camera::orbit::Orbit;
use crate::capture::dataset::{Dataset, evenly_spaced};
use crate::config::Config;
use crate::config::schedule::Budget;
use crate::field::checkpoint::{Checkpoint, FORMAT, FrameContents, Metadata, SplitNames};
use crate::field::layout::{Layout, finest_resolution};
use crate::field::state::State;
use crate::field::trainer::Trainer;
use crate::field::{Capabilities, Plan, SceneFeatures, Space};
use crate::gpu::Gpu;
use crate::photo::Reading;
use crate::photo::color_space::ColorSpace;
use crate::support::format::few;
use crate::support::remedy::{Advised, Remedy};
use anyhow::{Result, bail, ensure};
use std::fmt::Display;

/// A training run that can begin or go on.
#[derive(Debug)]
pub struct Resolved {
    /// What its checkpoints say, at the first step of this session.
    pub metadata: Metadata,
    /// How the kernels are linked.
    pub plan: Plan,
    /// Where an earlier session ended; `None` of a new run.
    pub state: Option<State>,
    /// Indices of the frames to train on.
    pub train: Vec<usize>,
    /// Indices of the frames to measure on.
    pub test: Vec<usize>,
    /// Kept samples of the usual batch, where the adapter does not bind buffers for as many.
    pub usual_kept: Option<usize>,
}

impl Resolved {
    /// A new run on the splits of `dataset`.
    ///
    /// # Errors
    /// When there is no frame to train on, a setting is unknown or out of range, or the photos are no use to it.
    pub fn new_run(options: &TrainOptions, dataset: &Dataset, gpu: &Gpu) -> Result<Self> {
        ensure!(!dataset.train.is_empty(), NO_FRAME);
        let Settings { config, usual_kept } = Settings::of(options, dataset, Some(gpu))?;
        let metadata = first(options, dataset, config)?;
        let metadata = ended(metadata, options, gpu, None)?;
        let plan = metadata.plan(Capabilities::of(gpu));
        let (train, test) = (dataset.train.clone(), dataset.test.clone());
        Ok(Self { metadata, plan, state: None, train, test, usual_kept })
    }

    /// The run that `checkpoint` holds, on the frames that it was trained on and with what `options` change.
    ///
    /// # Errors
    /// As [`Resolved::new_run`]; and when the dataset is another one or is read in another way, or the options change
    /// the size of the field.
    pub fn resume(
        options: &TrainOptions,
        dataset: &Dataset,
        gpu: &Gpu,
        checkpoint: Checkpoint,
    ) -> Result<Self> {
        let Checkpoint { metadata, state } = checkpoint;
        ensure!(!dataset.train.is_empty(), NO_FRAME);
        same_reading(&metadata.reading, &dataset.reading)?;
        let (train, test) = same_frames(&metadata, dataset)?;
        let earlier = metadata.budget;
        let metadata = again(options, metadata, dataset, &train)?;
        let metadata = ended(metadata, options, gpu, Some(earlier))?;
        let plan = metadata.plan(Capabilities::of(gpu));
        Ok(Self { metadata, plan, state: Some(state), train, test, usual_kept: None })
    }

    /// The photos to train on.
    #[must_use]
    pub fn photos<'a>(&'a self, dataset: &'a Dataset) -> TrainingPhotos<'a> {
        TrainingPhotos { dataset, frames: &self.train }
    }

    /// What training, its photos, and the measuring of the frames `tested` take, where there is room for it on the host and
    /// on the device; also reports it. With `overcommit` a host that seems too small is only warned of.
    ///
    /// # Errors
    /// When there is not; the message says how much there is, and what to do.
    pub fn check_memory(
        &self,
        gpu: &Gpu,
        dataset: &Dataset,
        tested: &[usize],
        overcommit: bool,
        observer: &mut dyn Observer,
    ) -> Result<MemoryUse> {
        let memory = self.photos(dataset).memory(&self.plan, tested, gpu.is_cpu());
        observer.notice(&Event::Memory(memory));
        memory.check_device(gpu, &self.plan)?;
        match memory.check_host(gpu.is_cpu()) {
            Err(shortage) if overcommit => {
                observer.notice(&Event::Warning(Warning::Overcommitted(shortage)));
                Ok(memory)
            }
            checked => checked.map(|()| memory).map_err(|shortage| memory.refusal(shortage)),
        }
    }

    /// What measures test views of what `trainer` trains, on black, with the photos of a `few` of them kept; `None`
    /// without test views.
    ///
    /// # Errors
    /// When the adapter refuses a kernel, or a photo cannot be read.
    pub fn evaluator<'a>(
        &self,
        trainer: &Trainer,
        dataset: &'a Dataset,
        few: usize,
    ) -> Result<Option<Evaluator<'a>>> {
        if self.test.is_empty() {
            return Ok(None);
        }
        let features = &self.metadata.features;
        let renderer = trainer.renderer(&features.lenses)?;
        let mut evaluator = Evaluator::new(renderer, ColorSpace::of(features.hdr), dataset);
        evaluator.keep(&evenly_spaced(&self.test, few))?;
        Ok(Some(evaluator))
    }
}

impl Config {
    /// The settings for a dataset when nothing is said: those of a software adapter where `is_cpu`.
    ///
    /// # Errors
    /// As [`Config::preset`].
    pub fn for_dataset(dataset: &Dataset, is_cpu: bool) -> Result<Self> {
        Self::preset(is_cpu, dataset.bounds.cascades > 1)
    }

    /// The same with a finest level of the grid: where it is left open, it follows the pixels of the training views.
    #[must_use]
    pub fn with_finest(mut self, dataset: &Dataset) -> Self {
        let cameras = dataset.cameras(&dataset.train);
        self.grid.finest = finest_resolution(&self.grid, &Space::from(&dataset.bounds), &cameras);
        self
    }
}

/// The description with its names and its end.
fn ended(metadata: Metadata, options: &TrainOptions, gpu: &Gpu, earlier: Option<Budget>) -> Result<Metadata> {
    let budget = options.budget(gpu.is_cpu(), earlier);
    if metadata.config.deterministic && budget.seconds.is_some() {
        let why = ": how many steps fit into a time differs from run to run";
        bail!(Advised::new("a deterministic run needs ", Remedy::StepsAlone, why));
    }
    let metadata = Metadata { adapter: gpu.info.name.clone(), budget, ..metadata };
    // What is not sound now would be found when its first checkpoint is read.
    metadata.validate()?;
    Ok(metadata)
}

fn first(options: &TrainOptions, dataset: &Dataset, config: Config) -> Result<Metadata> {
    let bounds = dataset.bounds.clone();
    let names = |indices: &[usize]| indices.iter().map(|&index| dataset.frames[index].name.clone()).collect();
    let orbit = Orbit::of(&dataset.cameras(&dataset.train), bounds.center);
    let splits =
        SplitNames { train: names(&dataset.train), val: names(&dataset.val), test: names(&dataset.test) };
    Ok(Metadata {
        format: FORMAT,
        dataset: options.dataset.clone(),
        adapter: String::new(),
        step: 0,
        rays: config.batch.first_rays,
        step_excess: 0.0,
        seconds: 0.0,
        budget: Budget::default(),
        features: SceneFeatures::of(dataset, &config)?,
        reading: dataset.reading.clone(),
        contents: FrameContents::of(dataset, &splits)?,
        splits,
        image_size: [orbit.width, orbit.height],
        has_alpha: dataset.is_cutout,
        orbit,
        config: config.into(),
        bounds,
    })
}

/// The description of an earlier session with what the options change; the field's size stays.
fn again(options: &TrainOptions, metadata: Metadata, dataset: &Dataset, train: &[usize]) -> Result<Metadata> {
    let config = options.configure(Config::clone(&metadata.config))?;
    let is_same = Layout::new(&config) == Layout::new(&metadata.config)
        && config.occupancy.cells == metadata.config.occupancy.cells;
    if !is_same {
        let found = "a training run cannot change its grid, network or occupancy grid ";
        bail!(Advised::new(found, Remedy::SameField, ""));
    }
    let features = metadata.features.clone().for_photos(dataset, train, &config)?;
    // A run from before its contents were kept has them from now on.
    let contents = match metadata.contents {
        None => FrameContents::of(dataset, &metadata.splits)?,
        known => known,
    };
    Ok(Metadata { features, contents, config: config.into(), ..metadata })
}

/// Photos must be read as before.
fn same_reading(then: &Reading, now: &Reading) -> Result<()> {
    let same = |setting: &'static str, then: &dyn Display, now: &dyn Display| -> Result<()> {
        let (then, now) = (then.to_string(), now.to_string());
        if then != now {
            bail!(Advised::new("", Remedy::SameReading { setting, then, now }, ""));
        }
        Ok(())
    };
    let alpha = |reading: &Reading| format!("{:?}", reading.alpha).to_lowercase();
    let most = |reading: &Reading| reading.max_images.map_or("all".to_owned(), |most| most.to_string());
    same("downscale", &then.downscale, &now.downscale)?;
    same("crop", &then.crop, &now.crop)?;
    same("max_images", &most(then), &most(now))?;
    same("alpha", &alpha(then), &alpha(now))?;
    same("invert_masks", &then.invert_masks, &now.invert_masks)
}

/// The frames that an earlier session used, by name.
fn same_frames(metadata: &Metadata, dataset: &Dataset) -> Result<(Vec<usize>, Vec<usize>)> {
    let (train, missing) = dataset.find(&metadata.splits.train);
    ensure!(
        missing.is_empty(),
        "{} frames that were trained on are not in this dataset ({}); resume with the dataset that the \
         training began with, {}",
        missing.len(),
        few(&missing),
        metadata.dataset
    );
    let test = dataset.find(&metadata.splits.test).0;
    let used = [&train[..], &test].concat();
    let differences = Differences::between(metadata, dataset, &used)?.describe();
    if let Some(what) = differences.or_else(|| coarse_difference(metadata, dataset, &train)) {
        let found = format!("{what} are not those of the run; ");
        bail!(Advised::new(found, Remedy::SameDataset { dataset: metadata.dataset.clone() }, ""));
    }
    ensure!(
        metadata.features.hdr == dataset.is_hdr,
        "the run began with images of another kind (display-referred or linear); resume with {}",
        metadata.dataset
    );
    Ok((train, test))
}

/// What can be told of runs from before their contents were kept.
fn coarse_difference(metadata: &Metadata, dataset: &Dataset, train: &[usize]) -> Option<String> {
    let orbit = Orbit::of(&dataset.cameras(train), metadata.bounds.center);
    let is_same = [orbit.width, orbit.height] == metadata.image_size
        && (orbit.radius - metadata.orbit.radius).abs() <= 1e-6 * orbit.radius;
    (metadata.contents.is_none() && !is_same).then(|| "the cameras of this dataset".to_owned())
}
