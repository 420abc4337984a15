//! The time of each stage of a step, and how close it comes to what the adapter can do.

use super::work::{Load, Work};
use anyhow::{Result, ensure};
use nerf::field::Plan;
use nerf::field::trainer::StepStats;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// Its work depends on the cells that it visits.
const UNCOUNTED: &str = "occupancy grid";

/// A stage in some steps.
#[derive(Debug, Serialize)]
pub(crate) struct StageTime {
    pub(crate) stage: String,
    pub(crate) ms_per_step: f64,
    pub(crate) ns_per_sample: f64,
    pub(crate) share: f64,
    /// What it has to do in a step; `None` for what is no stage.
    pub(crate) work: Option<Work>,
    pub(crate) ceiling: Option<Ceiling>,
}

/// How close a stage comes to what the adapter can do.
#[derive(Debug, Serialize)]
pub(crate) struct Ceiling {
    /// The least time that its work takes at the ceilings, over the time that it took.
    pub(crate) share: f64,
    /// What takes that time: arithmetic, memory, gathers or atomics.
    pub(crate) bound_by: &'static str,
}

/// Slowest first; what no stage accounts for comes last.
pub(crate) fn stage_times(
    totals: &BTreeMap<String, f64>,
    all_seconds: f64,
    stats: StepStats,
    plan: &Plan,
    ceilings: &Value,
) -> Result<Vec<StageTime>> {
    let steps = f64::from(stats.steps.max(1));
    let per_step = |count: u64| count as f64 / steps;
    let [rays, marched, kept] = [stats.rays, stats.marched, stats.samples].map(per_step);
    let load = Load { rays, marched, kept };
    let time = |stage: &str, seconds: f64, work: Option<Work>| {
        let least = work.and_then(|work| work.least_seconds(plan, ceilings));
        StageTime {
            stage: stage.to_owned(),
            ms_per_step: 1e3 * seconds / steps,
            ns_per_sample: 1e9 * seconds / stats.samples.max(1) as f64,
            share: seconds / all_seconds,
            work,
            ceiling: least
                .map(|(least, bound_by)| Ceiling { share: least * steps / seconds.max(1e-12), bound_by }),
        }
    };
    let mut stages = Vec::new();
    for (label, &seconds) in totals {
        let work = Work::of(plan, label, load);
        ensure!(work.is_some() || label == UNCOUNTED, "nobody counted the work of '{label}'");
        stages.push(time(label, seconds, work));
    }
    stages.sort_by(|a, b| b.ms_per_step.total_cmp(&a.ms_per_step));
    let rest = (all_seconds - totals.values().sum::<f64>()).max(0.0);
    stages.push(time("submission, waiting", rest, None));
    Ok(stages)
}

/// Lines for readers.
pub(crate) fn table(stages: &[StageTime]) -> Vec<String> {
    let columns =
        ["ms/step", "ns/sample", "share", "GFLOP/s", "GB/s", "gathers G/s", "atomics G/s", "of ceiling"];
    let mut head = format!("\n{:40}", "stage");
    columns.iter().for_each(|column| head += &format!(" {column:>11}"));
    let mut lines = vec![head];
    lines.extend(stages.iter().map(|stage| {
        let StageTime { stage: name, ms_per_step: ms, ns_per_sample: ns, share, work, ceiling } = stage;
        let mut line = format!("{name:40} {ms:11.3} {ns:11.1} {:10.1}%", 100.0 * share);
        if let Some(Work { flops, bytes, gathers, atomics, .. }) = work {
            for amount in [flops, bytes, gathers, atomics] {
                let rate = amount / ms.max(1e-12) / 1e6;
                line += &if *amount > 0.0 { format!(" {rate:11.2}") } else { format!(" {:>11}", "-") };
            }
        }
        if let Some(Ceiling { share, bound_by }) = ceiling {
            line += &format!(" {:10.1}% {bound_by}", 100.0 * share);
        }
        line
    }));
    lines
}
