//! Where the time of a training goes, from the device's timestamps.

use nerf::gpu::Gpu;
use nerf::gpu::timer::Timer;
use serde_json::{Value, json};

/// Of so many blocks, one is timed: its steps wait for the device each, which costs a little.
const BLOCKS_PER_TIMED: u32 = 16;

/// Times the stages of some steps.
#[derive(Debug)]
pub(super) struct StageTimes {
    /// `None` where the adapter has no timestamps.
    timer: Option<Timer>,
    steps: u32,
}

impl StageTimes {
    /// Nothing was timed yet.
    pub(super) fn new(gpu: &Gpu) -> Self {
        Self { timer: Timer::new(gpu).ok(), steps: 0 }
    }

    /// The timer for the steps of a block, if it is to be timed. Not the first one: an untrained field fills
    /// the whole box.
    pub(super) fn of_block(&mut self, block: u32) -> Option<&mut Self> {
        (self.timer.is_some() && block % BLOCKS_PER_TIMED == 1).then_some(self)
    }

    /// The timer for one step.
    pub(super) fn of_step(&mut self) -> Option<&mut Timer> {
        self.steps += 1;
        self.timer.as_mut()
    }

    /// The row of the log: milliseconds per step of each stage, the longest first. `None` when nothing was timed.
    pub(super) fn row(&self, step: u32) -> Option<Value> {
        let timer = self.timer.as_ref().filter(|_| self.steps > 0)?;
        let mut stages: Vec<_> = timer.totals().iter().collect();
        stages.sort_by(|(_, a), (_, b)| b.total_cmp(a));
        let per_step = 1e3 / f64::from(self.steps);
        let stages: Vec<_> = (stages.into_iter())
            .map(|(stage, seconds)| json!({ "stage": stage, "ms": seconds * per_step }))
            .collect();
        Some(json!({ "event": "stages", "step": step, "steps": self.steps, "stages": stages }))
    }
}
