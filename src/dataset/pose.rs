//! `transform_matrix`: a camera-to-world matrix in any of the shapes in use, made a rigid motion.

use anyhow::{Context, Result, ensure};
use glam::{DAffine3, DMat3, DVec3};

use super::json::Fields;
use super::notes::{Notes, Severity};

/// Reads the pose of a frame; `owner` names it in notes.
pub(super) fn read(fields: Fields, owner: &str, notes: &mut Notes) -> Result<DAffine3> {
    let numbers = fields
        .numbers("transform_matrix")?
        .context("`transform_matrix` is missing; every frame needs a camera-to-world matrix")?;
    ensure!(
        numbers.len() == 16 || numbers.len() == 12,
        "`transform_matrix` must have 4x4 or 3x4 numbers, found {}",
        numbers.len()
    );
    let at = |row: usize, column: usize| numbers[4 * row + column];
    let weight = if numbers.len() == 16 {
        let bottom = DVec3::new(at(3, 0), at(3, 1), at(3, 2));
        let right = DVec3::new(at(0, 3), at(1, 3), at(2, 3));
        ensure!(
            bottom.length() <= 1e-6 * (1.0 + right.length()),
            "`transform_matrix` must end in the row 0 0 0 1, found {bottom}; it may be transposed"
        );
        at(3, 3)
    } else {
        1.0
    };
    let column = |index: usize| DVec3::new(at(0, index), at(1, index), at(2, index));
    let linear = DMat3::from_cols(column(0), column(1), column(2));
    let translation = column(3) / weight;
    ensure!(
        translation.is_finite(),
        "`transform_matrix` has no finite position: its last number is {weight}"
    );
    Ok(DAffine3 { matrix3: rotation(linear, owner, notes)?, translation })
}

/// The rotation nearest to `linear` once its scale is taken out.
fn rotation(linear: DMat3, owner: &str, notes: &mut Notes) -> Result<DMat3> {
    let lengths = [linear.x_axis, linear.y_axis, linear.z_axis].map(DVec3::length);
    let volume: f64 = lengths.iter().product();
    let determinant = linear.determinant();
    ensure!(
        volume > 0.0 && volume.is_finite() && determinant.abs() > 1e-6 * volume,
        "`transform_matrix` is singular (determinant {determinant:e}); a camera needs three independent axes"
    );
    ensure!(
        determinant > 0.0,
        "`transform_matrix` is mirrored (determinant {determinant:.3}): its axes are left-handed; \
         negate one axis where it was exported, x right, y up, z backwards"
    );
    let scale = determinant.cbrt();
    if (scale - 1.0).abs() > 1e-3 {
        let message = "the rotation in `transform_matrix` is scaled; the scale was taken out";
        notes.frame(Severity::Note, owner, message);
    }
    // Newton's iteration for the polar decomposition.
    let mut rotation = linear * scale.recip();
    for _ in 0..30 {
        rotation = (rotation + rotation.inverse().transpose()) * 0.5;
    }
    let change = (linear * scale.recip() - rotation).to_cols_array();
    let change = change.into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    ensure!(
        change < 0.1,
        "`transform_matrix` is not a rotation: its axes have the lengths {lengths:.3?} or are not perpendicular"
    );
    if change > 1e-3 {
        let message =
            "the axes in `transform_matrix` are not quite perpendicular; the nearest rotation is used";
        notes.frame(Severity::Warning, owner, message);
    }
    Ok(rotation)
}
