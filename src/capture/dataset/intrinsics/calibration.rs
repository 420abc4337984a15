//! Calibration matrices.

use anyhow::{Result, bail, ensure};
use glam::DVec2;

use crate::capture::dataset::json::{Fields, REMEDY};
use crate::capture::dataset::notes::Notes;
use crate::capture::diagnostics::Severity;

const KEYS: [&str; 5] = ["K", "intrinsics", "intrinsic_matrix", "camera_matrix", "camera_intrinsics"];

#[derive(Clone, Copy, Debug)]
pub(super) struct Calibration {
    pub(super) focal_px: DVec2,
    pub(super) center_px: Option<DVec2>,
}

/// Focal length and principal point from a 3x3 or 4x4 matrix, or from fx, fy, cx, cy.
pub(super) fn read(fields: Fields, owner: &str, notes: &mut Notes) -> Result<Option<Calibration>> {
    let Some(key) = KEYS.into_iter().find(|key| fields.get(key).is_some_and(|value| value.is_array())) else {
        return Ok(None);
    };
    let numbers = fields.numbers(key)?.unwrap_or_default();
    let n = numbers.as_slice();
    let (stride, focal_px, center_px) = match n.len() {
        4 => (0, DVec2::new(n[0], n[1]), DVec2::new(n[2], n[3])),
        9 | 12 | 16 => {
            let stride = if n.len() == 9 { 3 } else { 4 };
            let (row, last) = (DVec2::new(n[2], n[stride + 2]), 2 * stride);
            // Some apps store the matrix by columns, with the principal point in the last row.
            let center = if row == DVec2::ZERO { DVec2::new(n[last], n[last + 1]) } else { row };
            (stride, DVec2::new(n[0], n[stride + 1]), center)
        }
        other => bail!("`{key}` must have 3x3 numbers, or fx, fy, cx, cy, found {other}; {REMEDY}"),
    };
    ensure!(
        focal_px.min_element() > 1e-6 && focal_px.max_element() < 1e9,
        "the focal lengths in `{key}` must be above 0 and below 1e9, found {} and {}; {REMEDY}",
        focal_px.x,
        focal_px.y
    );
    ensure!(
        center_px.abs().max_element() < 1e9,
        "the principal point in `{key}` must be below 1e9 pixels, found {}, {}; {REMEDY}",
        center_px.x,
        center_px.y
    );
    if stride > 0 && n[1].abs() > 1e-3 * focal_px.x {
        notes.frame(Severity::Warning, owner, format!("the skew in `{key}` is not modelled and ignored"));
    }
    // A matrix for the normalised plane leaves the principal point out.
    let center_px = Some(center_px).filter(|&center| center != DVec2::ZERO);
    Ok(Some(Calibration { focal_px, center_px }))
}
