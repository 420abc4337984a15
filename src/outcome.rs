//! Scores of test views, as text and as entries of a JSON result.

use nerf::run::report::test_views::Outcome;
use nerf::support::format::percent;
use serde_json::{Value, json};

/// One line of text.
pub(crate) fn describe(outcome: &Outcome) -> String {
    let Outcome { psnr, ssim, near_share, .. } = *outcome;
    let (measured, near) = (outcome.measured(), describe_near(near_share));
    format!("PSNR {psnr:.3} dB, SSIM {ssim:.4} over {measured} on black, {near}")
}

/// Adds the entries to a result; null where nothing was measured.
pub(crate) fn add(result: &mut Value, outcome: Option<&Outcome>) {
    result["psnr"] = json!(outcome.map(|outcome| outcome.psnr));
    result["ssim"] = json!(outcome.map(|outcome| outcome.ssim));
    result["near_share"] = json!(outcome.and_then(|outcome| outcome.near_share));
    result["background"] = json!(outcome.map(|_| "black"));
    result["views"] = json!(outcome.map_or(0, |outcome| outcome.views));
    result["views_left_out"] = json!(outcome.map_or(0, |outcome| outcome.left_out));
}

/// A near share in a line of results.
pub(crate) fn describe_near(share: Option<f64>) -> String {
    match share {
        Some(share) => format!("near share {}", percent(share)),
        None => "near share not told: the optical axes do not cross in one point".to_owned(),
    }
}
