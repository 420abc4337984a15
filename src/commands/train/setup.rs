//! What is trained, on what, and for how long: the command line, the dataset and an earlier training together.

use super::needs;
use crate::commands::find_frames;
use crate::progress::{duration, short};
use crate::remarks::Remarks;
use anyhow::{Result, ensure};
use nerf::camera::Camera;
use nerf::camera::orbit::Orbit;
use nerf::capture::dataset::Dataset;
use nerf::config::schedule::Budget;
use nerf::config::{Background, Config};
use nerf::field::checkpoint::{About, Checkpoint, FORMAT, Splits};
use nerf::field::layout::Layout;
use nerf::field::layout::finest_resolution;
use nerf::field::optimize::accumulation_name;
use nerf::field::state::State;
use nerf::field::{Capabilities, Plan, Space};
use nerf::gpu::Gpu;
use nerf::photo::Reading;
use nerf::support::format::{count, few};
use std::fmt::Display;
use std::path::Path;

/// Seconds of training on a CPU when nothing is said.
const CPU_SECONDS: f64 = 300.0;
/// Steps on a GPU when nothing is said.
const GPU_STEPS: u32 = 20_000;

/// What somebody wants to train, and for how long.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::commands) struct Wishes<'a> {
    /// The dataset's path, as it was given.
    pub(in crate::commands) dataset: &'a str,
    /// A file with settings.
    pub(in crate::commands) config: Option<&'a Path>,
    /// Single settings, `key.path=value`.
    pub(in crate::commands) set: &'a [String],
    /// The seed.
    pub(in crate::commands) seed: Option<u32>,
    /// What lies behind transparent photos.
    pub(in crate::commands) background: Option<Background>,
    /// The same checkpoint bit for bit.
    pub(in crate::commands) deterministic: bool,
    /// The end, if one is given.
    pub(in crate::commands) budget: Budget,
}

/// A training that can begin.
#[derive(Debug)]
pub(in crate::commands) struct Setup {
    /// What its checkpoints say, at the first step of this run.
    pub(in crate::commands) about: About,
    /// How the kernels are linked.
    pub(in crate::commands) plan: Plan,
    /// Where an earlier run ended.
    pub(in crate::commands) state: Option<State>,
    /// Frames to train on.
    pub(in crate::commands) train: Vec<usize>,
    /// Frames to measure on.
    pub(in crate::commands) test: Vec<usize>,
    /// The cameras to train on.
    pub(in crate::commands) cameras: Vec<Camera>,
}

impl Setup {
    /// A new training, or the one that `resumed` holds.
    pub(in crate::commands) fn new(
        wishes: &Wishes<'_>,
        dataset: &Dataset,
        gpu: &Gpu,
        resumed: Option<Checkpoint>,
    ) -> Result<Self> {
        ensure!(!dataset.train.is_empty(), "the dataset has no frame to train on");
        let (mut about, state, train, test) = match resumed {
            None => (first(wishes, dataset, gpu)?, None, dataset.train.clone(), dataset.test.clone()),
            Some(Checkpoint { about, state }) => {
                same_reading(&about.reading, &dataset.reading)?;
                let (train, test) = same_frames(&about, dataset)?;
                (again(wishes, about, dataset, &train)?, Some(state), train, test)
            }
        };
        about.dataset = wishes.dataset.to_owned();
        about.adapter.clone_from(&gpu.info.name);
        about.budget = budget(wishes, gpu, state.as_ref().map(|_| about.budget));
        about.budget.validate()?;
        ensure!(
            !about.config.deterministic || about.budget.seconds.is_none(),
            "a deterministic training needs --steps N and no --seconds: how many steps fit into a time differs from \
             run to run"
        );
        let plan = about.plan(Capabilities::of(gpu));
        let cameras = cameras(dataset, &train);
        Ok(Self { about, plan, state, train, test, cameras })
    }

    /// Says what was chosen, and what was left out.
    pub(in crate::commands) fn describe(&self, gpu: &Gpu, remarks: Remarks) {
        let About { config, budget, bounds, .. } = &self.about;
        let train = count(self.train.len(), "view");
        remarks.say(&format!("{train} to train on, {} to measure on", self.test.len()));
        remarks.detail(&format!(
            "scene box: centre {:.4}, half side {:.4}, {} cascades; {}",
            bounds.center, bounds.half, bounds.cascades, bounds.source
        ));
        let steps = budget.steps.map(|steps| format!("{steps} steps"));
        let ends: Vec<_> = steps.into_iter().chain(budget.seconds.map(duration)).collect();
        remarks.say(&format!(
            "training on {}: {} grid levels from {} to {} cells, up to 2^{} entries each; networks {} wide; {} \
             samples per step; {} for {}{}",
            gpu.info.name,
            config.grid.levels,
            config.grid.base,
            config.grid.finest,
            config.grid.log2_table,
            config.network.width,
            short(config.batch.kept as f64),
            accumulation_name(self.plan.accumulation),
            ends.join(" or "),
            if self.state.is_some() { format!(", from step {} on", self.about.step) } else { String::new() }
        ));
        remarks.say(&format!("left out: {}", self.plan.left_out().join(", ")));
    }
}

/// The cameras of some frames.
pub(in crate::commands) fn cameras(dataset: &Dataset, indices: &[usize]) -> Vec<Camera> {
    indices.iter().map(|&index| dataset.frames[index].camera.clone()).collect()
}

/// The settings: those of `config`, the file, single values, flags.
fn configure(mut config: Config, wishes: &Wishes<'_>) -> Result<Config> {
    if let Some(path) = wishes.config {
        config.merge_file(path)?;
    }
    for assignment in wishes.set {
        config.set(assignment)?;
    }
    config.seed = wishes.seed.unwrap_or(config.seed);
    config.background = wishes.background.unwrap_or(config.background);
    config.deterministic |= wishes.deterministic;
    config.validate()?;
    Ok(config)
}

/// The settings when nothing is said.
pub(in crate::commands) fn defaults(is_cpu: bool, dataset: &Dataset) -> Result<Config> {
    Config::preset(is_cpu, dataset.bounds.cascades > 1)
}

fn first(wishes: &Wishes<'_>, dataset: &Dataset, gpu: &Gpu) -> Result<About> {
    let bounds = dataset.bounds.clone();
    let defaults = defaults(gpu.is_cpu(), dataset)?;
    let mut config = configure(defaults, wishes)?;
    let cameras = cameras(dataset, &dataset.train);
    config.grid.finest = finest_resolution(&config.grid, &Space::from(&bounds), &cameras);
    let names = |indices: &[usize]| indices.iter().map(|&index| dataset.frames[index].name.clone()).collect();
    let orbit = Orbit::of(&cameras, bounds.center);
    let needs = needs::of(dataset, &config)?;
    Ok(About {
        format: FORMAT,
        dataset: String::new(),
        adapter: String::new(),
        step: 0,
        rays: config.batch.first_rays,
        step_excess: 0.0,
        seconds: 0.0,
        budget: Budget::default(),
        needs,
        reading: dataset.reading.clone(),
        splits: Splits { train: names(&dataset.train), val: names(&dataset.val), test: names(&dataset.test) },
        image_size: [orbit.width, orbit.height],
        has_alpha: dataset.is_cutout,
        orbit,
        config,
        bounds,
    })
}

/// The description of an earlier training with what the command line changes; the field's size stays.
fn again(wishes: &Wishes<'_>, mut about: About, dataset: &Dataset, train: &[usize]) -> Result<About> {
    let config = configure(about.config.clone(), wishes)?;
    ensure!(
        Layout::new(&config) == Layout::new(&about.config)
            && config.occupancy.cells == about.config.occupancy.cells,
        "a training cannot change its grid, network or occupancy grid on --resume; leave those settings out, or \
         start anew with --overwrite"
    );
    about.config = config;
    about.needs = needs::for_photos(about.needs, dataset, train, &about.config)?;
    Ok(about)
}

/// Photos must be read as before: the command line may not say otherwise.
fn same_reading(then: &Reading, now: &Reading) -> Result<()> {
    let differs = |flag: &str, then: &dyn Display, now: &dyn Display| -> Result<()> {
        let (then, now) = (then.to_string(), now.to_string());
        ensure!(
            then == now,
            "the training began with {flag} {then}, and now it is {now}; leave {flag} out on --resume, or start anew \
             with --overwrite"
        );
        Ok(())
    };
    let alpha = |reading: &Reading| format!("{:?}", reading.alpha).to_lowercase();
    let most = |reading: &Reading| reading.max_images.map_or("all".to_owned(), |most| most.to_string());
    differs("--downscale", &then.downscale, &now.downscale)?;
    differs("--crop", &then.crop, &now.crop)?;
    differs("--max-images", &most(then), &most(now))?;
    differs("--alpha", &alpha(then), &alpha(now))?;
    differs("--invert-masks", &then.invert_masks, &now.invert_masks)
}

/// The frames that an earlier training used, by name.
fn same_frames(about: &About, dataset: &Dataset) -> Result<(Vec<usize>, Vec<usize>)> {
    let (train, missing) = find_frames(dataset, &about.splits.train);
    ensure!(
        missing.is_empty(),
        "{} frames that were trained on are not in this dataset ({}); resume with the dataset that the \
         training began with, {}",
        missing.len(),
        few(&missing),
        about.dataset
    );
    let orbit = Orbit::of(&cameras(dataset, &train), about.bounds.center);
    let is_same = [orbit.width, orbit.height] == about.image_size
        && (orbit.radius - about.orbit.radius).abs() <= 1e-6 * orbit.radius;
    ensure!(
        is_same,
        "the frames of this dataset have other cameras than those trained on; resume with the dataset that the \
         training began with, {}",
        about.dataset
    );
    ensure!(
        about.needs.hdr == dataset.is_hdr,
        "the training began with images of another kind (display-referred or linear); resume with {}",
        about.dataset
    );
    Ok((train, find_frames(dataset, &about.splits.test).0))
}

/// The end asked for, else that of the earlier run, else one that suits the adapter.
fn budget(wishes: &Wishes<'_>, gpu: &Gpu, earlier: Option<Budget>) -> Budget {
    let suitable = match gpu.is_cpu() {
        true => Budget { steps: None, seconds: Some(CPU_SECONDS) },
        false => Budget { steps: Some(GPU_STEPS), seconds: None },
    };
    if wishes.budget == Budget::default() { earlier.unwrap_or(suitable) } else { wishes.budget }
}
