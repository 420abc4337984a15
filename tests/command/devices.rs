//! Devices that are lost, or whose memory is full.

use crate::program::{SMOKE, checkpoint, generated, place};
use nerf::capture::dataset::{Dataset, OpenOptions};
use nerf::config::schedule::Budget;
use nerf::gpu::{Gpu, WANTED_FEATURES, adapter};
use nerf::run::{
    EvaluationOptions, Event, Observer, Resolved, RunFolder, SavingOptions, TrainOptions, TrainingRun,
};
use nerf::support::remedy::{Advised, Remedy};
use nerf::support::transient::is_transient;
use std::path::PathBuf;
use std::sync::Arc;

/// Loses the device once there is a checkpoint.
struct Destroyer {
    gpu: Arc<Gpu>,
    saved: Option<u32>,
}

impl Observer for Destroyer {
    fn notice(&mut self, event: &Event<'_>) {
        if let Event::Saved { step, .. } = event {
            self.saved = Some(*step);
            self.gpu.device.destroy();
        }
    }
}

/// A run on a lost device ends at once with the last checkpoint, and is worth another try.
#[test]
fn a_lost_device_leaves_the_last_checkpoint() {
    let dataset = generated("toys", "lost", &["--views", "12", "--size", "30"]);
    let dataset = Dataset::open(&dataset, &OpenOptions::default()).expect("a dataset");
    for every in [None, Some(16)] {
        let path = place("lost");
        let gpu = Arc::new(Gpu::choose(None).expect("an adapter"));
        let budget = Budget { steps: Some(1_000_000), seconds: None };
        let options = TrainOptions { config: Some(PathBuf::from(SMOKE)), budget, ..TrainOptions::default() };
        let resolved = Resolved::new_run(&options, &dataset, &gpu).expect("it fits");
        let mut observer = Destroyer { gpu: Arc::clone(&gpu), saved: None };
        let evaluation = EvaluationOptions { every, ..EvaluationOptions::default() };
        let run = TrainingRun {
            gpu,
            dataset: &dataset,
            resolved,
            folder: RunFolder::unused(&path).expect("empty"),
            evaluation,
            saving: SavingOptions { every: 0.0, keep: 1 },
            overcommit: false,
        };
        let mut session = run.begin(&mut observer).expect("it begins");
        let failure = session.train(&mut observer).expect_err("the device is lost");
        let saved = observer.saved.expect("a checkpoint");
        let message = format!("{failure:#}");
        assert!(
            message.contains(&format!("(the checkpoint of step {saved} is kept): the adapter '")),
            "{message}"
        );
        assert!(message.contains("' was lost; try again"), "{message}");
        let advice = failure.downcast_ref::<Advised>().map(|advised| &advised.remedy);
        assert_eq!(advice, Some(&Remedy::RelieveDevice));
        assert!(is_transient(&failure));
        assert_eq!(checkpoint(&path).metadata.step, saved);
    }
}

/// Adapters that bind less than the preset's batch needs get a smaller one by themselves.
#[test]
fn batches_fit_what_an_adapter_binds() {
    let dataset = generated("toys", "small", &["--views", "6", "--size", "20"]);
    let dataset = Dataset::open(&dataset, &OpenOptions::default()).expect("a dataset");
    let adapter = adapter::choose(None).expect("an adapter");
    let resolved = |share: u64, options: &TrainOptions| {
        let mut limits = adapter.limits();
        let full = Gpu::open(&adapter).expect("it opens");
        let plan = Resolved::new_run(options, &dataset, &full).expect("it fits").plan;
        // Rows of textures on a CPU, bytes of buffers elsewhere, of the largest activations.
        let needed =
            plan.training_buffers(1).iter().find(|spec| spec.name == "density_hidden").map(|s| s.bytes());
        let most = needed.expect("activations") * share / 100;
        match full.is_cpu() {
            true => limits.max_texture_dimension_2d = most.div_ceil(16 * 1024) as u32,
            false => limits.max_storage_buffer_binding_size = most.next_multiple_of(16),
        }
        let small = Gpu::open_with(&adapter, WANTED_FEATURES, limits).expect("it opens");
        let resolved = Resolved::new_run(options, &dataset, &small).expect("settings");
        (resolved.plan.check(&small).is_ok(), resolved.usual_kept, resolved.metadata.config.batch.clone())
    };
    let options = TrainOptions { set: vec!["grid.log2_table=12".to_owned()], ..TrainOptions::default() };
    let (fits, usual_kept, usual) = resolved(100, &options);
    assert!(fits && usual_kept.is_none());
    let (fits, usual_kept, halved) = resolved(60, &options);
    assert!(fits, "{halved:?}");
    assert_eq!((usual_kept, halved.kept, halved.rays), (Some(usual.kept), usual.kept / 2, usual.rays / 2));
    let asked = TrainOptions { set: vec!["batch.first_rays=65".to_owned()], ..options };
    let (fits, usual_kept, batch) = resolved(60, &asked);
    assert!(!fits && usual_kept.is_none() && batch.kept == usual.kept, "what is asked for stays");
}
