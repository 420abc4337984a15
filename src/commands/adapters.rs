//! `nerf adapters`: what there is to run on.

use super::Session;
use anyhow::Result;
use nerf::gpu::adapter;
use serde_json::json;

pub(super) fn run(session: &Session<'_>) -> Result<()> {
    // Where there is none, its message says what to install.
    adapter::choose(None)?;
    let listings = adapter::list(&adapter::enumerate());
    let lines: Vec<String> = listings
        .iter()
        .map(|listing| {
            let features = if listing.features.is_empty() { "-".into() } else { listing.features.join(", ") };
            format!(
                "{}  {}  {} over {}  {}\n   largest binding {} MiB; {features}",
                listing.index,
                listing.name,
                listing.kind,
                listing.backend,
                listing.driver,
                listing.max_binding_bytes >> 20
            )
        })
        .collect();
    session.print(&json!({ "adapters": listings }), &lines.join("\n"))
}
