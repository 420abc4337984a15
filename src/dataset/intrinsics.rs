//! Focal length, principal point and lens, from whichever keys a tool chose to write.

mod calibration;
mod extent;
mod focal;
mod lens;

use std::f64::consts::{PI, TAU};

use anyhow::{Result, bail, ensure};
use glam::{DAffine3, DVec2};

use super::json::Fields;
use super::notes::{Note, Notes, Severity};
use crate::camera::{Camera, Lens};
use extent::{Extent, Measure};
use focal::{Angles, Focal};

/// The intrinsics of one frame as the file states them, not yet tied to an image size.
#[derive(Clone, Debug, PartialEq)]
pub struct Intrinsics {
    /// Image size in pixels as declared by `w` and `h`; may be fractional or differ from the image.
    pub declared_size: Option<DVec2>,
    /// `None` for lenses that need no focal length.
    focal: Option<Focal>,
    center: Option<Measure>,
    lens: Lens,
}

/// Keys of objects that hold the usual keys of a camera.
pub(super) const OBJECTS: [&str; 4] = ["intrinsics", "camera_intrinsics", "camera", "calibration"];

/// What one object of a file says about a camera: a frame, an object nested in it, or the file.
#[derive(Clone, Debug, Default)]
pub(super) struct Stated {
    size: Extent,
    focal_px: Option<DVec2>,
    angles: Angles,
    center_px: Option<DVec2>,
    lens: lens::Stated,
}

impl Stated {
    /// Reads one object; `owner` names it in notes.
    pub(super) fn read(fields: Fields, owner: &str, notes: &mut Notes) -> Result<Self> {
        let matrix = calibration::read(fields, owner, notes)?;
        Ok(Self {
            size: Extent::read(fields)?,
            focal_px: focal::pixels(fields)?.or(matrix.map(|matrix| matrix.focal_px)),
            angles: Angles::read(fields, owner, notes)?,
            center_px: center(fields)?.or(matrix.and_then(|matrix| matrix.center_px)),
            lens: lens::Stated::read(fields, owner, notes)?,
        })
    }
}

impl Intrinsics {
    /// Chooses from what is stated, in falling priority: the frame, what is nested in it, the file.
    pub(super) fn resolve(layers: &[&Stated], owner: &str, notes: &mut Notes) -> Result<Self> {
        let lens = lens::resolve(layers.iter().map(|layer| &layer.lens), owner, notes);
        let declared = layers.iter().fold(Extent::default(), |known, layer| known.or(layer.size));
        let size_of = |layer: &Stated| layer.size.or(declared).or(layer.implied_size());
        let center =
            layers.iter().find_map(|layer| Some(Measure { px: layer.center_px?, size: size_of(layer) }));
        let with_focal = layers.iter().find(|layer| layer.focal_px.is_some() || layer.angles.any());
        let focal = match (lens, with_focal) {
            (Lens::Equirectangular, stated) => {
                if stated.is_some() {
                    let message = "a whole sphere has no focal length and no principal point; those in the \
                                   file are ignored";
                    notes.frame(Severity::Note, owner, message);
                }
                None
            }
            (Lens::Orthographic, Some(Stated { focal_px: None, .. }) | None) => bail!(
                "an orthographic camera needs `fl_x`, the pixels per world unit, and a field of view does \
                 not tell it; write `fl_x`"
            ),
            (_, None) => bail!(
                "no focal length: expected `fl_x`, `fx`, `K`, `camera_angle_x` (radians) or `x_fov` \
                 (degrees) in the frame or the file; write one of them"
            ),
            (_, Some(layer)) => {
                let size = size_of(layer);
                if lens != Lens::Orthographic {
                    layer.compare(size, &lens, owner, notes);
                }
                Some(match layer.focal_px {
                    Some(px) => Focal::Pixels(Measure { px, size }),
                    None => Focal::HalfFov(layer.angles.half_tangents()),
                })
            }
        };
        Ok(Self { declared_size: declared.both(), focal, center, lens })
    }

    /// The camera that took an image of this size in pixels, and what is to be said about it. Lengths in
    /// pixels that belong to another size are scaled.
    pub fn camera(&self, size: [u32; 2], pose: DAffine3) -> (Camera, Vec<Note>) {
        let actual = DVec2::new(f64::from(size[0]), f64::from(size[1]));
        let mut remarks = Vec::new();
        let (focal_px, center_px) = match self.focal {
            None => {
                remarks.extend(sphere_remark(actual));
                (actual / DVec2::new(TAU, PI), 0.5 * actual)
            }
            Some(focal) => self.perspective(focal, actual, &mut remarks),
        };
        let (width, height) = (size[0], size[1]);
        (Camera { width, height, focal_px, center_px, lens: self.lens, world_from_camera: pose }, remarks)
    }

    /// Focal lengths and principal point at the size of an image.
    fn perspective(&self, focal: Focal, actual: DVec2, remarks: &mut Vec<Note>) -> (DVec2, DVec2) {
        let guess = self.center.and_then(|center| center.guessed_size(actual));
        let at_actual = |measure: Measure, remarks: &mut Vec<Note>| {
            let measure = Measure { size: measure.size.or_guess(guess), ..measure };
            let (px, remark) = measure.at(actual);
            if let Some(remark) = remark.filter(|remark| !remarks.contains(remark)) {
                remarks.push(remark);
            }
            px
        };
        let focal_px = match focal {
            Focal::Pixels(measure) => at_actual(measure, remarks),
            Focal::HalfFov(tangents) => focal::from_tangents(tangents, actual),
        };
        let center_px = self.center.map_or(0.5 * actual, |center| at_actual(center, remarks));
        let offset = (center_px / actual - 0.5).abs().max_element();
        if offset > 0.4 {
            remarks.push(Note {
                severity: Severity::Warning,
                message: format!(
                    "the principal point {:.1}, {:.1} lies at the edge of the image of {}x{} pixels or outside; \
                     unless the image was cut out of a larger one, `cx` and `cy` are wrong",
                    center_px.x, center_px.y, actual.x, actual.y
                ),
            });
        }
        (focal_px, center_px)
    }
}

impl Stated {
    /// The size at which focal lengths and fields of view say the same, for files that have no `w` and `h`.
    fn implied_size(&self) -> Extent {
        let Some(focal) = self.focal_px else {
            return Extent::default();
        };
        let [x, y] = self.angles.half_tangents();
        Extent::implied(x.map(|tangent| 2.0 * focal.x * tangent), y.map(|tangent| 2.0 * focal.y * tangent))
    }

    /// Two statements about the same lens that disagree are worth a look at the file.
    fn compare(&self, size: Extent, lens: &Lens, owner: &str, notes: &mut Notes) {
        let (Some(focal), Some(size)) = (self.focal_px, size.both()) else {
            return;
        };
        for axis in 0..2 {
            let Some(angle) = self.angles.0[axis] else {
                continue;
            };
            let from_angle = 0.5 * size[axis] / angle.half_tangent();
            let equidistant = size[axis] / angle.radians;
            let agrees = |other: f64| (other / focal[axis] - 1.0).abs() < 0.01;
            if !agrees(from_angle) && !(matches!(lens, Lens::Fisheye { .. }) && agrees(equidistant)) {
                let message = format!(
                    "`{}` is {:.2} pixels but `{}`, the field of view beside it, means {from_angle:.2}; the \
                     pixels are used",
                    ["fl_x", "fl_y"][axis],
                    focal[axis],
                    angle.key
                );
                notes.frame(Severity::Warning, owner, message);
            }
        }
    }
}

/// A panorama that is not twice as wide as high hardly shows the whole sphere.
fn sphere_remark(actual: DVec2) -> Option<Note> {
    ((0.5 * actual.x / actual.y - 1.0).abs() > 0.02).then(|| Note {
        severity: Severity::Warning,
        message: format!(
            "an equirectangular image is twice as wide as high, this one has {}x{} pixels; it is taken as the \
             whole sphere, squeezed",
            actual.x, actual.y
        ),
    })
}

/// Two numbers that come together; one alone is an error.
fn center(fields: Fields) -> Result<Option<DVec2>> {
    match (fields.number("cx")?, fields.number("cy")?) {
        (Some(x), Some(y)) => {
            let limit = 1e9;
            ensure!(
                x.abs() < limit && y.abs() < limit,
                "`cx` and `cy` must be below {limit} pixels, found {x}, {y}"
            );
            Ok(Some(DVec2::new(x, y)))
        }
        (None, None) => Ok(None),
        (Some(_), None) => bail!("`cx` is there but `cy` is missing; write both or neither"),
        (None, Some(_)) => bail!("`cy` is there but `cx` is missing; write both or neither"),
    }
}
