//! Devices that are lost, or whose memory is full.

use crate::program::{SMOKE, checkpoint, generated, place};
use nerf::capture::dataset::{Dataset, OpenOptions};
use nerf::config::schedule::Budget;
use nerf::gpu::Gpu;
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
