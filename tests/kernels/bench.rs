//! The workbench as the tests want it: what fails ends the test.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use bytemuck::Pod;
pub(crate) use nerf::check::draw::{Random, SEED, STEP, dimension, quiet_step, random_batch, uniform};
use nerf::check::{Forced, Subject, Tally, Workbench};
pub(crate) use nerf::check::{Kept, Outcome, Setup, visible_cells};
use nerf::gpu::pass::Stage;
use nerf::gpu::{Gpu, adapter};
use nerf::kernels::Counters;
use nerf::reference::model::{Model, TrainingRay};

/// Opens the adapter under test.
pub(crate) fn open() -> Gpu {
    let choice = std::env::var("NERF_ADAPTER").ok();
    let adapter = adapter::choose(choice.as_deref())
        .expect("these tests need a Vulkan, Metal or DX12 adapter; a software driver will do");
    Gpu::open(&adapter).expect("the adapter opens")
}

/// A workbench whose calls must not fail.
pub(crate) struct Bench(pub(crate) Workbench);

impl Deref for Bench {
    type Target = Workbench;
    fn deref(&self) -> &Workbench {
        &self.0
    }
}

impl DerefMut for Bench {
    fn deref_mut(&mut self) -> &mut Workbench {
        &mut self.0
    }
}

impl Bench {
    pub(crate) fn new(setup: &Setup) -> Self {
        Self(Workbench::new(&Arc::new(open()), setup).expect("buffers"))
    }

    pub(crate) fn read<T: Pod>(&self, name: &str, count: usize) -> Vec<T> {
        self.0.read(name, count).expect("a device that answers")
    }

    pub(crate) fn counters(&self) -> Counters {
        self.0.counters().expect("a device that answers")
    }

    pub(crate) fn run<'a>(&self, stages: impl IntoIterator<Item = &'a Stage>) {
        self.0.run(stages).expect("stages that run");
    }

    pub(crate) fn run_only(&self, stages: &[Stage], label: &str) {
        self.0.run_only(stages, label).expect("a stage that runs");
    }

    pub(crate) fn rays(&self, count: usize) -> Vec<[[f32; 4]; 2]> {
        self.0.rays(count).expect("a device that answers")
    }

    pub(crate) fn table(&self) -> Vec<f32> {
        self.0.table().expect("a device that answers")
    }

    pub(crate) fn table_moments(&self) -> [Vec<f32>; 2] {
        self.0.table_moments().expect("a device that answers")
    }

    pub(crate) fn kept(&self, count: usize) -> Vec<Kept> {
        self.0.kept(count).expect("a device that answers")
    }

    pub(crate) fn weights(&self, name: &str) -> Vec<Vec<f32>> {
        self.0.weights(name).expect("a device that answers")
    }

    pub(crate) fn set_weights(&self, name: &str, weights: &[Vec<f32>]) {
        self.0.set_weights(name, weights).expect("weights of the right size");
    }

    pub(crate) fn randomise(&self, random: &mut Random, table: f64, gain: f64) {
        self.0.randomise(random, table, gain).expect("weights of the right size");
    }

    pub(crate) fn model(&self) -> Model {
        self.0.model().expect("a device that answers")
    }

    pub(crate) fn upload(&self, rays: &[TrainingRay]) {
        self.0.upload(rays).expect("room for the batch");
    }

    pub(crate) fn density(&self, samples: usize) -> Vec<f32> {
        self.0.density(samples).expect("a device that answers")
    }

    pub(crate) fn stages(&self) -> Vec<Stage> {
        self.0.stages().expect("kernels")
    }

    pub(crate) fn train(&self, stages: &[Stage], rays: &[TrainingRay]) -> Outcome {
        self.0.train(stages, rays).expect("a device that answers")
    }
}

/// The adapter under test, with what its plan chooses.
pub(crate) fn subject() -> Subject {
    Subject::new(&Arc::new(open()), Forced::default()).expect("nothing is forced")
}

/// Prints what was found, and fails where a bound is broken.
#[track_caller]
pub(crate) fn passes(tallies: impl IntoIterator<Item = Tally>) {
    for tally in tallies {
        let Tally { name, cases, worst, bound, case, .. } = &tally;
        println!("{name}: {worst:.2e} of {bound:.1e} over {cases} cases; {case}");
        assert!(tally.pass, "{name}: {worst:e} is beyond {bound:e}: {case}");
    }
}
