//! Focal length, principal point and lens, from whichever keys a tool chose to write.

mod calibration;
mod focal;
mod image_size;
mod lens_model;

use std::f64::consts::{PI, TAU};

use anyhow::{Result, bail, ensure};
use glam::{DAffine3, DVec2};

use super::json::{Fields, REMEDY};
use super::notes::Notes;
use crate::camera::{Camera, Lens};
use crate::capture::diagnostics::{Diagnostic, Severity};
use focal::{Angles, Focal};
use image_size::{ImageSize, Measure};

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
    size: ImageSize,
    focal_px: Option<DVec2>,
    angles: Angles,
    center_px: Option<DVec2>,
    lens: lens_model::StatedLens,
}

impl Stated {
    /// Reads one object; `owner` names it in notes.
    pub(super) fn read(fields: Fields, owner: &str, notes: &mut Notes) -> Result<Self> {
        let matrix = calibration::read(fields, owner, notes)?;
        Ok(Self {
            size: ImageSize::read(fields)?,
            focal_px: focal::pixels(fields)?.or(matrix.map(|matrix| matrix.focal_px)),
            angles: Angles::read(fields, owner, notes)?,
            center_px: center(fields)?.or(matrix.and_then(|matrix| matrix.center_px)),
            lens: lens_model::StatedLens::read(fields, owner, notes)?,
        })
    }
}

impl Intrinsics {
    /// Chooses from what is stated, in falling priority: the frame, what is nested in it, the file.
    pub(super) fn resolve(layers: &[&Stated], owner: &str, notes: &mut Notes) -> Result<Self> {
        let lens = lens_model::resolve(layers.iter().map(|layer| &layer.lens), owner, notes);
        let declared = layers.iter().fold(ImageSize::default(), |known, layer| known.or(layer.size));
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

    /// Whether the camera looks everywhere, so that its view axis says nothing.
    pub(super) fn is_whole_sphere(&self) -> bool {
        self.lens == Lens::Equirectangular
    }

    /// The image size that the file means: the declared one, else the one that its lengths in pixels imply.
    pub fn likely_size(&self) -> Option<DVec2> {
        let focal = match self.focal {
            Some(Focal::Pixels(measure)) => measure.size.both(),
            _ => None,
        };
        let center = self.center.map(|center| center.size.both().unwrap_or(2.0 * center.px));
        let usable = |size: &DVec2| size.min_element() >= 1.0 && size.max_element() < 1e6;
        self.declared_size.or(focal.filter(usable)).or(center.filter(usable))
    }

    /// The camera that took an image of this size in pixels, and what is to be said about it. Lengths in
    /// pixels that belong to another size are scaled.
    pub fn camera(&self, size: [u32; 2], pose: DAffine3) -> (Camera, Vec<Diagnostic>) {
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
    fn perspective(&self, focal: Focal, actual: DVec2, remarks: &mut Vec<Diagnostic>) -> (DVec2, DVec2) {
        let guess = self.center.and_then(|center| center.guessed_size(actual));
        let at_actual = |measure: Measure, remarks: &mut Vec<Diagnostic>| {
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
            remarks.push(Diagnostic::warning(format!(
                "the principal point {:.1}, {:.1} lies at the edge of the image of {}x{} pixels or outside; \
                     unless the image was cut out of a larger one, `cx` and `cy` are wrong",
                center_px.x, center_px.y, actual.x, actual.y
            )));
        }
        (focal_px, center_px)
    }
}

impl Stated {
    /// The size at which focal lengths and fields of view say the same, for files that have no `w` and `h`.
    fn implied_size(&self) -> ImageSize {
        let Some(focal) = self.focal_px else {
            return ImageSize::default();
        };
        let [x, y] = self.angles.half_tangents();
        ImageSize::implied(x.map(|tangent| 2.0 * focal.x * tangent), y.map(|tangent| 2.0 * focal.y * tangent))
    }

    /// Two statements about the same lens that disagree are worth a look at the file.
    fn compare(&self, size: ImageSize, lens: &Lens, owner: &str, notes: &mut Notes) {
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
            let is_fisheye = matches!(lens, Lens::Fisheye { .. });
            if !(agrees(from_angle) || is_fisheye && agrees(equidistant)) {
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
fn sphere_remark(actual: DVec2) -> Option<Diagnostic> {
    ((0.5 * actual.x / actual.y - 1.0).abs() > 0.02).then(|| Diagnostic::warning(format!(
            "an equirectangular image is twice as wide as high, this one has {}x{} pixels; it is taken as the \
             whole sphere, squeezed",
            actual.x, actual.y
        )))
}

/// Two numbers that come together; one alone is an error.
fn center(fields: Fields) -> Result<Option<DVec2>> {
    match (fields.number("cx")?, fields.number("cy")?) {
        (Some(x), Some(y)) => {
            let limit = 1e9;
            ensure!(
                x.abs() < limit && y.abs() < limit,
                "`cx` and `cy` must be below {limit} pixels, found {x}, {y}; {REMEDY}"
            );
            Ok(Some(DVec2::new(x, y)))
        }
        (None, None) => Ok(None),
        (Some(_), None) => bail!("`cx` is there but `cy` is missing; write both or neither"),
        (None, Some(_)) => bail!("`cy` is there but `cx` is missing; write both or neither"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::dataset::transforms::tests::one;
    use serde_json::{Value, json};
    use std::f64::consts::FRAC_PI_2;

    /// The camera of one frame at the size of an image, and all that is said.
    fn read(frame: Value, file: Value, size: [u32; 2]) -> (Camera, String) {
        let listing = one(frame, file);
        let entry = &listing.frames[0];
        let (camera, remarks) = entry.intrinsics.camera(size, entry.world_from_camera);
        let notes = listing.notes().into_iter().chain(remarks);
        (camera, notes.map(|note| format!("{:?}: {note}\n", note.severity)).collect())
    }

    /// Focal lengths and principal point.
    fn lengths(camera: &Camera) -> [f64; 4] {
        let all = [camera.focal_px.x, camera.focal_px.y, camera.center_px.x, camera.center_px.y];
        all.map(|length| (1e9 * length).round() / 1e9)
    }

    #[test]
    fn frames_go_before_what_is_nested_and_that_before_the_file() {
        let file = json!({"w": 80, "h": 60, "fl_x": 40, "cx": 41, "cy": 31, "intrinsics": {"fx": 9}});
        let focal = |frame: Value| lengths(&read(frame, file.clone(), [80, 60]).0)[0];
        assert_eq!(focal(json!({})), 40.0);
        assert_eq!(focal(json!({"camera": {"fl_x": 30}})), 30.0);
        assert_eq!(focal(json!({"fy": 20, "camera": {"fl_x": 30}})), 20.0);
        assert_eq!(focal(json!({"K": [[8, 0, 3], [0, 9, 4], [0, 0, 1]]})), 8.0);
        assert_eq!(focal(json!({"intrinsic_matrix": [8, 0, 3, 0, 0, 9, 4, 0, 0, 0, 1, 0, 0, 0, 0, 1]})), 8.0);
        assert_eq!(focal(json!({"intrinsics": [8, 9, 3, 4]})), 8.0);
        assert_eq!(focal(json!({"fl_x": " 7.5 "})), 7.5);
        assert_eq!(focal(json!({"x_fov": 90})), 40.0);
        assert_eq!(focal(json!({"fl_x": null, "fovx": 90})), 40.0);
        let own_center = read(json!({"cx": 1, "cy": 30}), file.clone(), [80, 60]).0;
        assert_eq!(lengths(&own_center)[2..], [1.0, 30.0]);
    }

    #[test]
    fn pixels_that_disagree_with_angles_are_used_and_reported() {
        let file = json!({"w": 80, "h": 60, "camera_angle_x": FRAC_PI_2});
        assert_eq!(read(json!({"fl_x": 50}), file, [80, 60]).1, "", "other objects are not compared");
        let angles = json!({"camera_angle_x": FRAC_PI_2, "camera_angle_y": FRAC_PI_2, "fl_x": 50});
        let (camera, said) = read(angles, json!({"w": 80, "h": 60}), [80, 60]);
        assert_eq!(lengths(&camera)[..2], [50.0, 50.0]);
        assert!(said.contains("Warning: frame 0 'a': `fl_x` is 50.00 pixels but `camera_angle_x`"), "{said}");
        assert!(said.contains("means 40.00") && said.contains("means 30.00"), "{said}");
    }

    #[test]
    fn shrunk_images_are_noticed_without_a_declared_size() {
        let file = json!({"fl_x": 40, "camera_angle_x": FRAC_PI_2, "cx": 44, "cy": 32});
        let (camera, said) = read(json!({}), file.clone(), [40, 30]);
        assert_eq!(lengths(&camera), [20.0, 20.0, 22.0, 16.0]);
        let expected = "Warning: without `w` and `h`, focal length and field of view agree on 80x60 pixels";
        assert!(said.contains(expected), "{said}");
        assert_eq!(read(json!({}), file, [80, 60]).1, "");
        // Only the principal point tells.
        let center = |cx: f64, cy: f64| read(json!({}), json!({"fl_x": 40, "cx": cx, "cy": cy}), [20, 15]);
        let (camera, said) = center(39.0, 30.5);
        assert_eq!(lengths(&camera), [10.0, 10.0, 9.75, 7.625]);
        assert!(said.contains("the principal point is the middle of 80x60 pixels, the image has 20x15"));
        let (camera, said) = center(39.0, 2.0);
        assert_eq!(lengths(&camera), [40.0, 40.0, 39.0, 2.0]);
        assert!(said.contains("Warning: the principal point 39.0, 2.0 lies at the edge"), "{said}");
        assert_eq!(center(10.4, 7.1).1, "");
    }

    #[test]
    fn declared_sizes_that_differ_from_the_image_scale() {
        let file = json!({"w": 80.0, "h": 60.4, "fl_x": 40, "cx": 44, "cy": 32});
        let at = |size: [u32; 2]| read(json!({}), file.clone(), size);
        assert_eq!(at([80, 60]).1, "");
        let (camera, said) = at([40, 30]);
        assert_eq!(camera.center_px.x, 22.0);
        assert!(
            said.starts_with("Note: the file's intrinsics belong to 80x60.4 pixels, the image has 40x30")
        );
        let said = at([60, 80]).1;
        assert!(said.contains("Warning") && said.contains("width and height are swapped"), "{said}");
        let said = at([80, 40]).1;
        assert!(said.contains("Warning") && said.contains("the aspect ratios differ"), "{said}");
        let (camera, _) = read(json!({"w": 160, "h": 120}), file.clone(), [160, 120]);
        let expected = [80.0, 79.470_198_675, 88.0, 63.576_158_94];
        assert_eq!(lengths(&camera), expected, "the file's pixels are of the file's size");
    }

    #[test]
    fn angles_in_the_wrong_unit_are_noticed() {
        let (camera, said) = read(json!({}), json!({"camera_angle_x": 90}), [80, 60]);
        assert_eq!(lengths(&camera), [40.0, 40.0, 40.0, 30.0]);
        assert!(said.contains("cannot be radians"), "{said}");
        assert!(read(json!({}), json!({"fovx": 0.7}), [80, 60]).1.contains("read as degrees"));
        let (camera, _) = read(json!({}), json!({"y_fov": 90}), [80, 60]);
        assert_eq!(lengths(&camera)[..2], [30.0, 30.0]);
    }

    #[test]
    fn whole_spheres_and_parallel_rays_have_their_own_lengths() {
        let file = json!({"camera_model": "EQUIRECTANGULAR", "fl_x": 1, "cx": 3, "cy": 9, "w": 64, "h": 32});
        let (camera, said) = read(json!({}), file, [128, 64]);
        assert_eq!(camera.lens, Lens::Equirectangular);
        assert_eq!(camera.focal_px, DVec2::new(128.0 / TAU, 64.0 / PI));
        assert_eq!(camera.center_px, DVec2::new(64.0, 32.0));
        assert!(said.contains("Note: frame 0 'a': a whole sphere has no focal length"), "{said}");
        assert!(read(json!({}), json!({"latlong": true}), [128, 80]).1.contains("twice as wide as high"));
        let file = json!({"orthographic": 1, "fl_x": 5, "w": 64, "h": 32});
        let (camera, said) = read(json!({}), file, [32, 16]);
        assert_eq!((camera.lens, camera.focal_px.x), (Lens::Orthographic, 2.5));
        assert!(said.starts_with("Note: the file's intrinsics belong to 64x32"), "{said}");
    }
}
