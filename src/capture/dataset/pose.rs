//! Poses: a camera-to-world matrix in any of the shapes in use, made an orthonormal matrix and a
//! translation.

pub(super) mod handedness;

use anyhow::{Context, Result, bail, ensure};
use glam::{DAffine3, DMat3, DMat4, DVec3, DVec4};

use super::json::{Fields, Matrix};
use super::notes::Notes;
use crate::capture::diagnostics::Severity;

/// Positions beyond this many world units are a mistake, and nothing that f32 can still tell apart.
const FARTHEST: f64 = 1e12;
/// A last row that is no further off 0 0 0 1 is noise, as scripts add it that disturb poses.
const MOST_OFF: f64 = 0.1;

/// What the columns of a file's rotations are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axes {
    /// Right, up, back: the original NeRF's, nearly everybody's.
    OpenGl,
    /// Right, down, forward.
    OpenCv,
    /// Left, down, back: what instant-ngp makes of `from_mitsuba`.
    Mitsuba,
}

impl Axes {
    /// The axes that the flags of a file ask for.
    pub(super) fn of(file: Fields) -> Result<Self> {
        // NeuS2's dialect.
        if file.flag("from_na")? == Some(true) {
            return Ok(Self::OpenCv);
        }
        let from_mitsuba = file.flag("from_mitsuba")?.unwrap_or(file.has(&["normal_mts_args"]));
        Ok(if from_mitsuba { Self::Mitsuba } else { Self::OpenGl })
    }

    /// To right, up, back.
    fn signs(self) -> DVec3 {
        match self {
            Self::OpenGl => DVec3::ONE,
            Self::OpenCv => DVec3::new(1.0, -1.0, -1.0),
            Self::Mitsuba => DVec3::new(-1.0, -1.0, 1.0),
        }
    }
}

/// Reads the pose of a frame, or `None` where it is not finite; `owner` names the frame in notes. The
/// matrix may still be mirrored, which is for [`handedness`] to judge.
pub(super) fn read(fields: Fields, axes: Axes, owner: &str, notes: &mut Notes) -> Result<Option<DAffine3>> {
    let Some((key, matrix, axes)) = stated(fields, axes, owner, notes)? else {
        return Ok(None);
    };
    let Some(matrix) = upright(key, &matrix, owner, notes)? else {
        return Ok(None);
    };
    let matrix = matrix * matrix.w_axis.w.recip();
    let translation = matrix.w_axis.truncate();
    ensure!(
        translation.is_finite() && translation.abs().max_element() < FARTHEST,
        "`{key}` must put the camera within {FARTHEST:e} world units, found a distance of {:e}; correct the frame or \
         take it out",
        translation.length()
    );
    let linear = DMat3::from_mat4(matrix) * DMat3::from_diagonal(axes.signs());
    Ok(Some(DAffine3 { matrix3: orthonormal(key, linear, owner, notes)?, translation }))
}

/// The numbers of the pose, the key they stand under and what the columns are; `None` where the matrix
/// is null, as JavaScript writes what is not a number.
fn stated(
    fields: Fields,
    axes: Axes,
    owner: &str,
    notes: &mut Notes,
) -> Result<Option<(&'static str, Matrix, Axes)>> {
    const KEYS: [(&str, Option<Axes>); 4] = [
        ("transform_matrix", None),
        // nerfstudio's exporter of cameras.
        ("transform", Some(Axes::OpenGl)),
        ("camera_to_world", None),
        // SDFStudio.
        ("camtoworld", Some(Axes::OpenCv)),
    ];
    let (start, end) = ("transform_matrix_start", "transform_matrix_end");
    if let Some(mut matrix) = fields.matrix(start)? {
        if let Some(last) = fields.matrix(end)?.filter(|last| last.numbers.len() == matrix.numbers.len()) {
            for (a, b) in matrix.numbers.iter_mut().zip(last.numbers) {
                *a = 0.5 * (*a + b);
            }
            let message = "the camera moves during the exposure; the pose halfway between \
                           `transform_matrix_start` and `transform_matrix_end` is used";
            notes.frame(Severity::Warning, owner, message);
        }
        return Ok(Some((start, matrix, axes)));
    }
    for (key, own_axes) in KEYS {
        if let Some(matrix) = fields.matrix(key)? {
            return Ok(Some((key, matrix, own_axes.unwrap_or(axes))));
        }
    }
    if KEYS.iter().any(|(key, _)| fields.0.contains_key(*key)) {
        return Ok(None);
    }
    bail!(
        "`transform_matrix` is missing; every frame needs a camera-to-world matrix, so write it or take the frame out"
    )
}

/// The 4x4 matrix with the translation in its last column and the last row 0 0 0 w.
fn upright(key: &str, stated: &Matrix, owner: &str, notes: &mut Notes) -> Result<Option<DMat4>> {
    let numbers = &stated.numbers;
    let mut rows = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let is_four_by_three = stated.rows == Some([4, 3]);
    match numbers.len() {
        12 if is_four_by_three => {
            for (row, values) in numbers.chunks_exact(3).enumerate() {
                rows[4 * row..4 * row + 3].copy_from_slice(values);
            }
        }
        12 | 16 => rows[..numbers.len()].copy_from_slice(numbers),
        other => {
            bail!("`{key}` must have 4x4 or 3x4 numbers, found {other}; write it camera-to-world, row by row")
        }
    }
    if rows.iter().any(|number| !number.is_finite()) {
        return Ok(None);
    }
    // Rows become columns here.
    let transposed = DMat4::from_cols_array(&rows);
    let matrix = transposed.transpose();
    if is_affine(matrix) && !is_four_by_three {
        return Ok(Some(matrix));
    }
    if is_affine(transposed) {
        let message = "the matrix has its translation in the last row; it was transposed";
        notes.frame(Severity::Note, owner, message);
        return Ok(Some(transposed));
    }
    let off = |matrix: DMat4| (matrix.row(3) - DVec4::W).abs().max_element();
    if off(matrix) <= MOST_OFF {
        notes.worst(Severity::Warning, owner, off(matrix), |off| {
            format!(
                "the last row of the pose must be 0 0 0 1 and is off by up to {off:.2e}, as if noise had been added; the \
                 first three rows are used"
            )
        });
        let linear = DMat3::from_mat4(matrix);
        return Ok(Some(DMat4::from(DAffine3::from_mat3_translation(linear, matrix.w_axis.truncate()))));
    }
    let what = match off(transposed) <= MOST_OFF {
        true => "what looks like the translation of a transposed matrix, ",
        false => "",
    };
    bail!(
        "`{key}` must end in the row 0 0 0 1, found {what}{}; write it camera-to-world, row by row",
        matrix.row(3)
    )
}

/// Whether a matrix ends in the row 0 0 0 w, as far as that can be told beside its translation. Another w than 1 is
/// a scale of the whole, unless it is so near to 1 that it is no scale.
fn is_affine(matrix: DMat4) -> bool {
    let row = matrix.row(3);
    let strays = row.truncate().abs().max_element() / (1.0 + matrix.w_axis.truncate().abs().max_element());
    let off = (row.w - 1.0).abs();
    strays <= 1e-6 && row.w != 0.0 && (off <= 1e-6 || off > MOST_OFF)
}

/// The orthonormal matrix nearest to `linear` once its scale is taken out; it keeps the handedness.
fn orthonormal(key: &str, linear: DMat3, owner: &str, notes: &mut Notes) -> Result<DMat3> {
    let size = linear.to_cols_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    let unit = linear * size.recip();
    let lengths = [unit.x_axis, unit.y_axis, unit.z_axis].map(DVec3::length);
    let volume: f64 = lengths.iter().product();
    let determinant = unit.determinant();
    ensure!(
        determinant.is_finite() && determinant.abs() > 1e-6 * volume,
        "`{key}` must have three independent axes, found the columns {} {} {}; correct the frame or take it out",
        linear.x_axis,
        linear.y_axis,
        linear.z_axis
    );
    let scale = determinant.abs().cbrt();
    if (scale * size - 1.0).abs() > 1e-3 {
        notes.frame(
            Severity::Note,
            owner,
            format!("the rotation in `{key}` is scaled; the scale was taken out"),
        );
    }
    let start = unit * scale.recip();
    let rotation = polar_factor(start).context("the rotation could not be found")?;
    let change = (start - rotation).to_cols_array();
    let change = change.into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    ensure!(
        change < 0.1,
        "`{key}` must be a rotation, found columns of the lengths {:.3?} or not perpendicular; export rigid poses",
        lengths.map(|length| length * size)
    );
    if change > 1e-3 {
        let message =
            format!("the axes in `{key}` are not quite perpendicular; the nearest rotation is used");
        notes.frame(Severity::Warning, owner, message);
    }
    Ok(rotation)
}

/// The orthonormal factor of the polar decomposition, by Newton's iteration (Higham 1986).
fn polar_factor(start: DMat3) -> Option<DMat3> {
    let mut factor = start;
    for _ in 0..60 {
        let next = (factor + factor.inverse().transpose()) * 0.5;
        let is_settled = next.abs_diff_eq(factor, 1e-15);
        factor = next;
        if is_settled {
            break;
        }
    }
    factor.is_finite().then_some(factor)
}
