//! The page as HTML. What comes from files is escaped by `maud`.

use super::colormap::{INFERNO, gradient};
use super::pictures::{ERROR_SCALE, LONGEST_SIDE};
use super::test_views::{EVENLY_SPACED, Row, TestViews, WORST};
use super::{Report, curves, distances, time};
use crate::run::depths::{Depths, fog};
use crate::run::log::Start;
use crate::support::format::{count, duration, length, percent, plural, short};
use anyhow::Result;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use std::path::Path;

const STYLE: &str = include_str!("style.css");
/// Views that the table of scores shows unfolded.
const UNFOLDED: usize = 12;
/// Pictures narrower than this are enlarged with sharp pixels.
const SMALL: u32 = 160;

/// The whole page.
pub(super) fn page(report: &Report) -> Result<String> {
    let name = name(report);
    let charts = charts(report)?;
    let test_views = test_views(report)?;
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (name) " · nerf report" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                header { h1 { (name) } (subtitle(report)) }
                main {
                    (warnings(report))
                    (figures(report))
                    (charts)
                    (test_views)
                    (time::section(&report.log))
                    (setting(report))
                }
                footer {
                    "Written by nerf " (env!("CARGO_PKG_VERSION")) ". Seconds are of training alone: loading, compiling, \
                    evaluating and saving are not in them."
                }
            }
        }
    };
    Ok(markup.into_string())
}

/// The last part of the dataset's name, else of the folder's.
fn name(report: &Report) -> String {
    let path = report.facts.dataset.as_ref().unwrap_or(&report.facts.run);
    Path::new(path).file_name().map_or_else(|| path.clone(), |name| name.to_string_lossy().into_owned())
}

fn subtitle(report: &Report) -> Markup {
    let facts = &report.facts;
    let trained = facts.trained.map(|time| humantime::format_rfc3339_seconds(time).to_string());
    let trained = trained.and_then(|text| Some(format!("{} {} UTC", text.get(..10)?, text.get(11..16)?)));
    html! {
        p.subtitle {
            "Radiance field"
            @if let Some(dataset) = &facts.dataset { " of " code { (dataset) } }
            @if let Some(trained) = trained { ", trained " (trained) }
            @if let Some(adapter) = adapter(report) { " on " (adapter) }
        }
    }
}

fn adapter(report: &Report) -> Option<&String> {
    latest(report, |start| start.adapter.as_ref()).or(report.facts.adapter.as_ref())
}

/// What the newest start that tells it says.
fn latest<'a, T>(report: &'a Report, value: impl Fn(&'a Start) -> Option<T>) -> Option<T> {
    report.log.starts.iter().rev().find_map(value)
}

/// What a reader must know before the numbers.
fn warnings(report: &Report) -> Markup {
    let (skipped, damaged) = (report.log.skipped(), report.log.damaged);
    let fog = report.summary().and_then(|summary| fog(summary.near_share?));
    html! {
        @if skipped > 0 {
            p.warning {
                strong { (skipped) (plural(skipped, " step was skipped", " steps were skipped")) ". " }
                "Gradients were not finite or far too large there, and nothing was learnt. If it happens often, lower "
                code { "optimizer.learning_rate" } "."
            }
        }
        @if let Some(fog) = fog { p.warning { strong { "Fog: " } (fog) "." } }
        @if report.facts.is_done == Some(false) {
            p.warning {
                strong { "The run was interrupted before its end. " }
                "Resumed in its folder, it goes on from the last checkpoint."
            }
        }
        @if report.log.steps.is_empty() {
            p.warning { strong { "There is no log of steps. " } "Curves and speeds are missing below." }
        }
        @if damaged > 0 {
            p.warning {
                strong { (damaged) (plural(damaged as u64, " line", " lines")) " of the log could not be read. " }
                "A crash tears the last line; the others are shown."
            }
        }
    }
}

/// The results, large.
fn figures(report: &Report) -> Markup {
    let log = &report.log;
    let mut figures: Vec<(String, String)> = Vec::new();
    if let Some(summary) = report.summary() {
        let of = summary.measured();
        figures.push((format!("{:.2} dB", summary.psnr), format!("PSNR of {of}")));
        figures.push((format!("{:.4}", summary.ssim), format!("SSIM of {of}")));
        let near =
            summary.near_share.map(|share| (percent(share), "of pixels near: a sign of fog".to_owned()));
        figures.extend(near);
    } else if let Some(psnr) = log.steps.iter().rev().find_map(|row| row.psnr) {
        figures.push((format!("{psnr:.2} dB"), "PSNR of the rays trained on".to_owned()));
    }
    let steps = report.steps().map(|steps| (steps.to_string(), "steps".to_owned()));
    let seconds = report.seconds().map(|seconds| (duration(seconds), "of training".to_owned()));
    let speed = log.samples_per_second().map(|speed| (short(speed), "samples per second".to_owned()));
    figures.extend(steps.into_iter().chain(seconds).chain(speed));
    html! {
        dl.figures {
            @for (number, label) in &figures {
                div { dt { (label) } dd { (number) } }
            }
        }
    }
}

fn charts(report: &Report) -> Result<Markup> {
    let [width, height] = curves::SIZE;
    let drawn = curves::charts(&report.log).into_iter().map(|chart| chart.svg(width, height));
    let drawn = drawn.collect::<Result<Vec<_>>>()?;
    Ok(html! {
        @if !drawn.is_empty() {
            section {
                h2 { "Training curves" }
                div.charts { @for svg in &drawn { figure { (PreEscaped(svg)) } } }
            }
        }
    })
}

fn test_views(report: &Report) -> Result<Markup> {
    Ok(html! {
        section {
            h2 { "Test views" }
            @match &report.views {
                Err(reason) => { p.remark { (reason) } }
                Ok(views) if views.count() == 0 => { p.remark { "There are no test views." } }
                Ok(views) => {
                    (gallery(views, report.facts.hdr))
                    (distances::section(views)?)
                    (scores(views))
                }
            }
        }
    })
}

fn gallery(views: &TestViews, hdr: bool) -> Markup {
    let rows = views.worst_first();
    let shown: Vec<&Row> = rows.into_iter().filter(|row| row.pictures.is_some()).collect();
    html! {
        p.remark {
            (views.count()) (plural(views.count() as u64, " view", " views")) " on black, never trained on. "
            @if shown.len() < views.count() {
                "Shown are " (shown.len()) ": the " (WORST) " worst and " (EVENLY_SPACED) " evenly spaced ones, "
            } @else { "They are shown " }
            "worst first, at most " (LONGEST_SIDE) " pixels wide and high; the scores are of the full size. Select one to enlarge it."
            @if hdr { " Linear light is clamped to 0…1 and sRGB-encoded, for the pictures and for the scores." }
            @if views.left_out > 0 {
                " " (views.left_out) (plural(views.left_out as u64, " more was", " more were"))
                " left out, because measuring takes at most a tenth of the training time; "
                code { "nerf eval RUN DATASET" } " measures all, and " code { "nerf report RUN" } " shows them."
            }
            @if !views.missing.is_empty() {
                " " (views.missing.len()) (plural(views.missing.len() as u64, " view is", " views are"))
                " missing in this dataset: " (views.missing[0]) @if views.missing.len() > 1 { ", …" }
            }
        }
        p.scale {
            "Absolute error, mean of red, green and blue, of colours from 0 to 1: "
            span.bar { "0 " i style=(format!("background: {}", gradient(&INFERNO))) {}
                " " (ERROR_SCALE) " and more" }
            @if shown.iter().any(|row| row.pictures.as_ref().is_some_and(|pictures| pictures.has_ignored)) {
                "; striped grey where a mask ignores the photo"
            }
        }
        (distances::scale(views))
        div.views { @for (number, row) in shown.into_iter().enumerate() { (card(number, row)) } }
    }
}

fn card(number: usize, row: &Row) -> Markup {
    let id = format!("view-{number}");
    html! {
        @if let Some(pictures) = &row.pictures {
            @let [width, height] = pictures.size;
            @let score = format!("{:.2} dB · SSIM {:.4}", row.scores.psnr, row.scores.ssim);
            @let depth = format!("depth, 1 = {}", length(pictures.unit));
            @let pictures = [
                ("rendering", &pictures.rendered, "rendering"),
                ("photo", &pictures.photo, "photo"),
                ("error", &pictures.error, "error"),
                ("depth", &pictures.depth, &depth),
            ];
            article id=(id) {
                h3 { span.name { (row.scores.name) } span.score { (score) } }
                a.pictures href=(format!("#{id}")) {
                    @for (what, address, caption) in pictures {
                        figure {
                            img class=[(width < SMALL).then_some("small")] src=(address) width=(width) height=(height)
                                alt=(format!("{what} of {}", row.scores.name));
                            figcaption { (caption) }
                        }
                    }
                }
            }
        }
    }
}

fn scores(views: &TestViews) -> Markup {
    html! {
        details open[views.count() <= UNFOLDED] {
            summary { "Scores of " (views.count()) (plural(views.count() as u64, " view", " views")) ", worst first" }
            div.wide {
                table.scores {
                    thead { tr { th { "view" } th.number { "PSNR, dB" } th.number { "SSIM" } th.number { "near" } } }
                    tbody {
                        @for row in views.worst_first() {
                            @let view = &row.scores;
                            @let near = view.depths.as_ref().and_then(Depths::near_share);
                            tr {
                                td.name { (view.name) }
                                td.number { (format!("{:.3}", view.psnr)) }
                                td.number { (format!("{:.4}", view.ssim)) }
                                td.number { (near.map_or_else(|| "–".to_owned(), percent)) }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// How it was trained: machine, views, what was left out, settings.
fn setting(report: &Report) -> Markup {
    let facts = &report.facts;
    let left_out = latest(report, |start| Some(&start.left_out).filter(|parts| !parts.is_empty()));
    html! {
        section {
            h2 { "Setting" }
            dl.facts {
                @if let Some(adapter) = adapter(report) { dt { "Adapter" } dd { (adapter) } }
                @if let Some(driver) = latest(report, |start| start.driver.as_ref()) { dt { "Driver" } dd { (driver) } }
                dt { "Folder" } dd { code { (facts.run) } }
                @if let Some(views) = facts.train_views { dt { "Trained on" } dd { (count(views, "view")) } }
                @if let Some(left_out) = left_out {
                    dt { "Left out" }
                    dd { ul { @for part in left_out { li { (part) } } }
                        "What the scene does not need is neither linked nor allocated nor run." }
                }
            }
            @if let Some(settings) = &facts.settings {
                details { summary { "All settings" } pre { (settings) } }
            }
        }
    }
}
