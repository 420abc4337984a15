//! Where the time of a training run goes, from the device's timestamps.

use super::log::StageTime;
use crate::gpu::Gpu;
use crate::gpu::timer::Timer;

/// Of so many blocks, one is timed: its steps wait for the device each, which costs a little.
const BLOCKS_PER_TIMED: u32 = 16;

/// Times the stages of some steps.
#[derive(Debug)]
pub struct StageTimes {
    /// `None` where the adapter has no timestamps.
    timer: Option<Timer>,
    steps: u32,
}

impl StageTimes {
    /// Nothing was timed yet.
    #[must_use]
    pub fn new(gpu: &Gpu) -> Self {
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

    /// Steps that were timed.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Each stage's time, the longest first; none when nothing was timed.
    #[must_use]
    pub fn per_step(&self) -> Vec<StageTime> {
        let timer = self.timer.as_ref().filter(|_| self.steps > 0);
        let per_step = 1e3 / f64::from(self.steps.max(1));
        let mut stages: Vec<_> = timer.iter().flat_map(|timer| timer.totals()).collect();
        stages.sort_by(|(_, a), (_, b)| b.total_cmp(a));
        let time =
            |(stage, seconds): (&String, &f64)| StageTime { stage: stage.clone(), ms: seconds * per_step };
        stages.into_iter().map(time).collect()
    }
}
