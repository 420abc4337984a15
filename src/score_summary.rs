//! Scores of test views, as text and as entries of a JSON result.

use nerf::run::report::test_views::ScoreSummary;
use nerf::support::format::percent;
use serde_json::{Value, json};

/// One line of text.
pub(crate) fn describe(summary: &ScoreSummary) -> String {
    let ScoreSummary { psnr, ssim, near_share, .. } = *summary;
    let (measured, near) = (summary.measured(), describe_near(near_share));
    format!("PSNR {psnr:.3} dB, SSIM {ssim:.4} over {measured} on black, {near}")
}

/// Adds the entries to a result; null where nothing was measured.
pub(crate) fn add(result: &mut Value, summary: Option<&ScoreSummary>) {
    result["psnr"] = json!(summary.map(|summary| summary.psnr));
    result["ssim"] = json!(summary.map(|summary| summary.ssim));
    result["near_share"] = json!(summary.and_then(|summary| summary.near_share));
    result["background"] = json!(summary.map(|_| "black"));
    result["views"] = json!(summary.map_or(0, |summary| summary.views));
    result["views_left_out"] = json!(summary.map_or(0, |summary| summary.left_out));
}

/// A near share in a line of results.
pub(crate) fn describe_near(share: Option<f64>) -> String {
    match share {
        Some(share) => format!("near share {}", percent(share)),
        None => "near share not told: the optical axes do not cross in one point".to_owned(),
    }
}
