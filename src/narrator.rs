//! Reports the events of a run on stderr.

use crate::console::Console;
use crate::progress::{Progress, duration, short};
use nerf::field::Plan;
use nerf::field::checkpoint::Metadata;
use nerf::field::optimize::accumulation_name;
use nerf::gpu::Gpu;
use nerf::run::memory::MemoryUse;
use nerf::run::{DepthTold, Event, Observer, StepsTaken};
use nerf::support::format::{bytes, count, percent};

/// Prints events, and shows progress for long ones.
#[derive(Debug)]
pub(crate) struct Narrator {
    console: Console,
    /// Of what is going on, and its title.
    progress: Option<(&'static str, Progress)>,
}

impl Observer for Narrator {
    fn notice(&mut self, event: &Event<'_>) {
        match *event {
            Event::Resolved { metadata, plan, gpu, test_views } => {
                self.describe(metadata, plan, gpu, test_views);
            }
            Event::Memory(memory) => self.say(&memory_line(&memory)),
            Event::Depth(told) => self.say(&depth_line(&told)),
            Event::Loading { done, all } => self.count("loading", (done, all), "images"),
            Event::Steps(taken) => {
                self.progress("training").update(taken.spent, || steps_line(&taken));
            }
            Event::Evaluated { step, means } => {
                let views = count(means.views, "test view");
                self.say(&format!("step {step}: PSNR {:.2} dB over {views}", means.psnr));
            }
            Event::Saved { .. } => {}
            Event::Measuring { done, all } => self.count("measuring", (done, all), "views"),
            Event::Ended => self.progress = None,
            Event::Warning(warning) => self.say(&format!("warning: {warning}")),
        }
    }
}

impl Narrator {
    /// Says as much as the console prints.
    pub(crate) fn new(console: Console) -> Self {
        Self { console, progress: None }
    }

    /// A line that stays.
    fn say(&self, line: &str) {
        match &self.progress {
            Some((_, progress)) => progress.say(line),
            None => self.console.say(line),
        }
    }

    /// The progress of what is called `title`, from now on if something else went on before.
    fn progress(&mut self, title: &'static str) -> &Progress {
        let current = self.progress.take().filter(|(current, _)| *current == title);
        &self.progress.insert(current.unwrap_or_else(|| (title, Progress::new(self.console, title)))).1
    }

    /// `done` of `all` things are done.
    fn count(&mut self, title: &'static str, (done, all): (usize, usize), things: &str) {
        let progress = self.progress(title);
        if done > 0 {
            progress.count(done, all, things);
        }
        if done == all {
            self.progress = None;
        }
    }

    /// Says what was chosen, and what was left out.
    fn describe(&self, metadata: &Metadata, plan: &Plan, gpu: &Gpu, test_views: usize) {
        let Metadata { config, budget, bounds, splits, step, .. } = metadata;
        let train = count(splits.train.len(), "view");
        self.console.say(&format!("{train} to train on, {test_views} to measure on"));
        let scene_box = format!(
            "scene box: centre {:.4}, half side {:.4}, {}; {}",
            bounds.center,
            bounds.half,
            count(bounds.cascades as usize, "cascade"),
            bounds.source
        );
        if bounds.is_guess {
            self.console.say(&format!("{scene_box}; `nerf info` tells what it needs to know better"));
        } else {
            self.console.detail(&scene_box);
        }
        let steps = budget.steps.map(|steps| count(steps as usize, "step"));
        let ends: Vec<_> = steps.into_iter().chain(budget.seconds.map(duration)).collect();
        let from = if *step > 0 { format!(", from step {step} on") } else { String::new() };
        self.console.say(&format!(
            "training on {}: {} grid levels from {} to {} cells, up to 2^{} entries each; networks {} wide; {} \
             samples per step; {} for {}{}",
            gpu.info.name,
            config.grid.levels,
            config.grid.base,
            config.grid.finest,
            config.grid.log2_table,
            config.network.width,
            short(config.batch.kept as f64),
            accumulation_name(plan.accumulation),
            ends.join(" or "),
            from
        ));
        self.console.say(&format!("left out: {}", plan.left_out().join(", ")));
    }
}

fn depth_line(told: &DepthTold) -> String {
    let photos = count(told.photos, "photo");
    let known = format!("depth: known in {} of the pixels of {photos}", percent(told.known));
    match told.far {
        0.0 => known,
        far => format!("{known}; {} of the values stand for far away and are not trained on", percent(far)),
    }
}

fn memory_line(memory: &MemoryUse) -> String {
    let [host, device, photos] = [memory.host_bytes, memory.device_bytes, memory.photo_bytes].map(bytes);
    format!("memory: {host} on the host, {device} on the device, {photos} of it photos")
}

fn steps_line(taken: &StepsTaken) -> String {
    let stats = &taken.block.stats;
    let per_second = |count: u64| short(count as f64 / taken.block.seconds.max(1e-9));
    format!(
        "step {}, loss {:.5}, {}, {} rays/s, {} samples/s, {}, {} to go",
        taken.step,
        stats.loss,
        taken.psnr.map_or_else(
            || format!("relative error {:.1} %", 100.0 * stats.color_error.sqrt()),
            |psnr| format!("PSNR {psnr:.2} dB")
        ),
        per_second(stats.rays),
        per_second(stats.samples),
        duration(taken.seconds),
        duration(taken.remaining)
    )
}
