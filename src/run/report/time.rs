//! Where the time went: the stages of a step, and what is paid once.

use crate::run::log::{Log, Stages};
use crate::support::format::{duration, plural};
use maud::{Markup, html};

/// The section; empty where nothing was timed.
pub(super) fn section(log: &Log) -> Markup {
    let once = once(log);
    let stages = log.stages.as_ref().filter(|stages| !stages.stages.is_empty());
    html! {
        @if stages.is_some() || !once.is_empty() {
            section {
                h2 { "Time" }
                div.columns {
                    @if let Some(stages) = stages { (table_of_stages(stages)) }
                    @if !once.is_empty() { (table_of_costs(&once)) }
                }
            }
        }
    }
}

fn table_of_stages(stages: &Stages) -> Markup {
    let total: f64 = stages.stages.iter().map(|stage| stage.ms).sum();
    let longest = stages.stages.iter().map(|stage| stage.ms).fold(f64::MIN_POSITIVE, f64::max);
    html! {
        table.stages {
            caption {
                "One step on the device, by stage: the mean of " (stages.steps)
                (plural(stages.steps, " timed step", " timed steps")) " up to step " (stages.step)
            }
            thead { tr { th { "stage" } th.number { "ms" } th.number { "share" } th {} } }
            tbody {
                @for stage in &stages.stages {
                    tr {
                        td { (stage.stage) }
                        td.number { (format!("{:.2}", stage.ms)) }
                        td.number { (format!("{:.1} %", 100.0 * stage.ms / total.max(f64::MIN_POSITIVE))) }
                        td.share {
                            span style=(format!("width: {:.1}%", 100.0 * stage.ms.max(0.0) / longest)) {}
                        }
                    }
                }
            }
            tfoot { tr { td { "all" } td.number { (format!("{total:.2}")) } td.number {} td {} } }
        }
    }
}

fn table_of_costs(once: &[(String, f64)]) -> Markup {
    html! {
        table.costs {
            caption { "Paid once, outside of the training time" }
            thead { tr { th { "what" } th.number { "time" } } }
            tbody {
                @for (what, seconds) in once {
                    tr { td { (what) } td.number { (duration(*seconds)) } }
                }
            }
        }
    }
}

/// Costs apart from the steps, in seconds.
fn once(log: &Log) -> Vec<(String, f64)> {
    let mut once = Vec::new();
    for start in &log.starts {
        let when = if start.step > 0 { format!(", resuming at step {}", start.step) } else { String::new() };
        once.extend(start.load_seconds.map(|seconds| (format!("loading images{when}"), seconds)));
        once.extend(start.compile_seconds.map(|seconds| (format!("compiling and preparing{when}"), seconds)));
    }
    let (while_training, final_ones): (Vec<_>, Vec<_>) =
        log.evaluations.iter().partition(|row| row.eval_ssim.is_none());
    for (what, rows) in [
        ("measuring test views while training", while_training),
        ("measuring test views at the end", final_ones),
    ] {
        let seconds: Vec<f64> = rows.iter().filter_map(|row| row.eval_seconds).collect();
        if !seconds.is_empty() {
            once.push((what.to_owned(), seconds.iter().sum()));
        }
    }
    once
}
