//! Focal length, principal point and lens, from whichever keys a tool chose to write.

use anyhow::{Context, Result, bail, ensure};
use glam::{DAffine3, DVec2};

use super::json::Fields;
use super::notes::{Notes, Severity};
use crate::camera::{Camera, Lens};

/// The intrinsics of one frame as the file states them, not yet tied to an image size.
#[derive(Clone, Debug, PartialEq)]
pub struct Intrinsics {
    /// Image size in pixels as declared by `w` and `h`; may be fractional or differ from the image.
    pub declared_size: Option<DVec2>,
    focal: Focal,
    center: Option<Measure>,
    lens: Lens,
}

/// A length in pixels of an image of some size.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Measure {
    px: DVec2,
    size: Option<DVec2>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Focal {
    Pixels(Measure),
    /// Tangent of half the field of view along x, y; at least one is known.
    HalfFov(Option<f64>, Option<f64>),
}

/// Reads from objects in falling priority: the frame, what is nested in it, the file.
pub(super) fn read(layers: &[Fields], owner: &str, notes: &mut Notes) -> Result<Intrinsics> {
    refuse_other_projections(layers)?;
    let sizes: Vec<_> = layers.iter().map(|&f| size(f)).collect::<Result<_>>()?;
    let declared_size = sizes.iter().flatten().next().copied();
    let mut focal = None;
    let mut center = None;
    let mut lens = None;
    for (&fields, &size) in layers.iter().zip(&sizes) {
        let measure = |px| Measure { px, size: size.or(declared_size) };
        let matrix = matrix(fields)?;
        if focal.is_none() {
            focal = match focal_px(fields, matrix)? {
                Some(px) => {
                    compare_with_angle(fields, measure(px), owner, notes)?;
                    Some(Focal::Pixels(measure(px)))
                }
                None => half_fov(fields)?,
            };
        }
        center = match (center, pair(fields, "cx", "cy")?, matrix) {
            (None, Some(px), _) => Some(measure(px)),
            (None, None, Some((_, px))) => Some(measure(px)),
            (known, _, _) => known,
        };
        lens = match lens {
            None => self::lens(fields)?,
            known => known,
        };
    }
    let focal = focal.context(
        "no focal length: expected `fl_x`, `camera_angle_x`, `x_fov`, `fx` or `K` in the frame or the file",
    )?;
    Ok(Intrinsics { declared_size, focal, center, lens: lens.unwrap_or_default() })
}

impl Intrinsics {
    /// The camera that took an image of this size in pixels. Lengths in pixels that belong to another
    /// size are scaled, and the returned sentence says so.
    pub fn camera(&self, size: [u32; 2], pose: DAffine3) -> (Camera, Option<String>) {
        let actual = DVec2::new(f64::from(size[0]), f64::from(size[1]));
        let mut rescaled = None;
        let mut scaled = |measure: Measure| match measure.size {
            // Exporters round sizes, and some write fractional ones.
            Some(declared) if (declared - actual).abs().max_element() >= 1.0 => {
                rescaled = Some(declared);
                measure.px * actual / declared
            }
            _ => measure.px,
        };
        let focal_px = match self.focal {
            Focal::Pixels(measure) => scaled(measure),
            Focal::HalfFov(x, y) => {
                let x = x.map(|tangent| 0.5 * actual.x / tangent);
                let y = y.map(|tangent| 0.5 * actual.y / tangent);
                let either = x.or(y).unwrap_or(f64::NAN);
                DVec2::new(x.unwrap_or(either), y.unwrap_or(either))
            }
        };
        let center_px = self.center.map_or(0.5 * actual, scaled);
        let camera = Camera {
            width: size[0],
            height: size[1],
            focal_px,
            center_px,
            lens: self.lens,
            world_from_camera: pose,
        };
        (camera, rescaled.map(|from| rescale_note(from, actual)))
    }
}

fn rescale_note(declared: DVec2, actual: DVec2) -> String {
    let ratio = actual / declared;
    let (a, d) = (actual, declared);
    let mut note = format!(
        "the file's intrinsics belong to {}x{} pixels, the image has {}x{}; they were scaled",
        d.x, d.y, a.x, a.y
    );
    if (ratio.x / ratio.y - 1.0).abs() > 0.02 {
        note += "; the aspect ratios differ, so the image may be cropped or rotated and the cameras wrong";
    }
    note
}

fn size(fields: Fields) -> Result<Option<DVec2>> {
    let [w, h] = ["w", "h"].map(|key| fields.positive(key, 1e6));
    Ok(w?.zip(h?).map(DVec2::from))
}

/// Two numbers that come together; one alone is an error.
fn pair(fields: Fields, x: &str, y: &str) -> Result<Option<DVec2>> {
    match (fields.number(x)?, fields.number(y)?) {
        (Some(x), Some(y)) => Ok(Some(DVec2::new(x, y))),
        (None, None) => Ok(None),
        (Some(_), None) => bail!("`{x}` is there but `{y}` is missing"),
        (None, Some(_)) => bail!("`{y}` is there but `{x}` is missing"),
    }
}

/// Focal length and principal point from a 3x3 calibration matrix.
fn matrix(fields: Fields) -> Result<Option<(DVec2, DVec2)>> {
    for key in ["K", "intrinsics", "intrinsic_matrix"] {
        if !fields.get(key).is_some_and(|value| value.is_array()) {
            continue;
        }
        let Some(n) = fields.numbers(key)? else {
            continue;
        };
        let stride = match n.len() {
            9 => 3,
            16 => 4,
            4 => return Ok(Some((DVec2::new(n[0], n[1]), DVec2::new(n[2], n[3])))),
            other => bail!("`{key}` must have 3x3 numbers, found {other}"),
        };
        let (row, column) = (DVec2::new(n[2], n[stride + 2]), 2 * stride);
        // Some apps store the matrix by columns, with the principal point in the last row.
        let center = if row == DVec2::ZERO { DVec2::new(n[column], n[column + 1]) } else { row };
        return Ok(Some((DVec2::new(n[0], n[stride + 1]), center)));
    }
    Ok(None)
}

fn focal_px(fields: Fields, matrix: Option<(DVec2, DVec2)>) -> Result<Option<DVec2>> {
    for (x, y) in [("fl_x", "fl_y"), ("fx", "fy")] {
        let (fx, fy) = (fields.positive(x, 1e9)?, fields.positive(y, 1e9)?);
        if let Some(either) = fx.or(fy) {
            return Ok(Some(DVec2::new(fx.unwrap_or(either), fy.unwrap_or(either))));
        }
    }
    let Some((focal, _)) = matrix else {
        return Ok(None);
    };
    ensure!(
        focal.min_element() > 0.0,
        "the focal lengths in the calibration matrix must be above 0, found {focal}"
    );
    Ok(Some(focal))
}

fn half_fov(fields: Fields) -> Result<Option<Focal>> {
    let tangent = |key: &str, half_turn: f64| -> Result<Option<f64>> {
        let angle = fields.positive(key, half_turn)?;
        Ok(angle.map(|angle| (0.5 * angle / half_turn * std::f64::consts::PI).tan()))
    };
    for (x, y, half_turn) in
        [("x_fov", "y_fov", 180.0), ("camera_angle_x", "camera_angle_y", std::f64::consts::PI)]
    {
        let (x, y) = (tangent(x, half_turn)?, tangent(y, half_turn)?);
        if x.is_some() || y.is_some() {
            return Ok(Some(Focal::HalfFov(x, y)));
        }
    }
    Ok(None)
}

/// Two statements about the same lens that disagree are worth a look at the file.
fn compare_with_angle(fields: Fields, focal: Measure, owner: &str, notes: &mut Notes) -> Result<()> {
    let (Some(Focal::HalfFov(Some(tangent), _)), Some(size)) = (half_fov(fields)?, focal.size) else {
        return Ok(());
    };
    let from_angle = 0.5 * size.x / tangent;
    if (from_angle / focal.px.x - 1.0).abs() > 0.01 {
        let message = format!(
            "`fl_x` is {:.2} pixels but the field of view beside it means {from_angle:.2}; `fl_x` is used",
            focal.px.x
        );
        notes.frame(Severity::Warning, owner, message);
    }
    Ok(())
}

fn lens(fields: Fields) -> Result<Option<Lens>> {
    let model = fields.text("camera_model")?.unwrap_or_default().to_uppercase();
    match model.as_str() {
        "ORTHOGRAPHIC" => return Ok(Some(Lens::Orthographic)),
        "EQUIRECTANGULAR" => return Ok(Some(Lens::Equirectangular)),
        _ => {}
    }
    const KEYS: [&str; 6] = ["k1", "k2", "k3", "k4", "p1", "p2"];
    let mut values = [0.0; 6];
    if let Some(list) = fields.numbers("distortion_params")? {
        ensure!(
            list.len() <= 6,
            "`distortion_params` must have k1 k2 k3 k4 p1 p2, found {} numbers",
            list.len()
        );
        values[..list.len()].copy_from_slice(&list);
    } else if fields.has(&KEYS) {
        for (value, key) in values.iter_mut().zip(KEYS) {
            *value = fields.number(key)?.unwrap_or(0.0);
        }
    } else {
        return Ok(None);
    }
    let [k1, k2, k3, k4, p1, p2] = values;
    if model == "OPENCV_FISHEYE" {
        return Ok(Some(Lens::Fisheye { k: [k1, k2, k3, k4] }));
    }
    if values == [0.0; 6] {
        return Ok(Some(Lens::Pinhole));
    }
    Ok(Some(Lens::OpenCv { k: [k1, k2, k3, k4], p: [p1, p2] }))
}

fn refuse_other_projections(layers: &[Fields]) -> Result<()> {
    const ACCEPTED: [&str; 10] = [
        "PINHOLE",
        "SIMPLE_PINHOLE",
        "PERSPECTIVE",
        "OPENCV",
        "SIMPLE_RADIAL",
        "RADIAL",
        "BROWN",
        "OPENCV_FISHEYE",
        "ORTHOGRAPHIC",
        "EQUIRECTANGULAR",
    ];
    for fields in layers {
        if let Some(model) = fields.text("camera_model")? {
            ensure!(
                ACCEPTED.contains(&model.to_uppercase().as_str()),
                "`camera_model` {model} is not supported yet, only {}; undistort the images to PINHOLE",
                ACCEPTED.join(", ")
            );
            break;
        }
    }
    for fields in layers {
        for key in ["is_fisheye", "equirectangular", "latlong", "orthographic"] {
            ensure!(
                !fields.flag(key)?,
                "`{key}` cameras are not supported yet; undistort the images to a pinhole camera"
            );
        }
        ensure!(
            !fields.has(&["ftheta_p0"]),
            "f-theta lenses (`ftheta_p0`) are not supported yet; undistort the images to a pinhole camera"
        );
    }
    Ok(())
}
