//! `nerf generate`: an analytic scene as a dataset.

use super::Session;
use crate::cli::generate::Generate;
use crate::progress::Progress;
use anyhow::{Context, Result};
use nerf::support::format::count;
use nerf::verify::scene::{self, ViewCounts};
use serde_json::json;

pub(super) fn run(args: &Generate, session: &Session<'_>) -> Result<()> {
    if args.list {
        return list(session);
    }
    let name = args.scene.as_deref().context("the name of a scene is needed; see --list")?;
    let out = args.out.as_deref().context("--out DIR is needed")?;
    let options = scene::SceneOptions {
        scene: name.to_owned(),
        views: ViewCounts::of_total(args.views).context("--views")?,
        size: args.size,
        hdr: args.hdr,
        lenses: args.lens.clone(),
        samples: args.samples,
        seed: args.seed,
        interrupt: session.signals.interrupt.clone(),
    };
    let progress = Progress::new(session.console, "generating");
    let total = options.views.total();
    let summary = scene::generate(&options, out, &|done| progress.count(done, total, "views"))?;
    drop(progress);
    let folder = out.display();
    let text = format!(
        "{} of {}, {} in {folder}",
        count(summary.views, "view"),
        summary.scene,
        count(summary.files, "file")
    );
    let mut result = serde_json::to_value(&summary)?;
    result["out"] = json!(folder.to_string());
    session.print(&result, &text)
}

fn list(session: &Session<'_>) -> Result<()> {
    let scenes = scene::names();
    let lines: Vec<_> = scenes.iter().map(|info| format!("{:10} {}", info.name, info.description)).collect();
    let entries: Vec<_> =
        scenes.iter().map(|info| json!({ "name": info.name, "description": info.description })).collect();
    session.print(&json!({ "scenes": entries }), &lines.join("\n"))
}
