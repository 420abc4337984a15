//! Lenses: the projection that a file names and the coefficients beside it.

use anyhow::{Result, bail, ensure};

use crate::camera::Lens;
use crate::capture::dataset::json::{Fields, shortened};
use crate::capture::dataset::notes::Notes;
use crate::capture::diagnostics::Severity;

/// What one object of a file says about the lens.
#[derive(Clone, Debug, Default)]
pub(super) struct StatedLens {
    projection: Option<Projection>,
    /// The name under which the projection is written, where it promises no distortion.
    undistorted: Option<&'static str>,
    coefficients: Option<Coefficients>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Projection {
    Perspective,
    Fisheye,
    Equirectangular,
    Orthographic,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Coefficients {
    k: [f64; 4],
    p: [f64; 2],
    /// A list in OpenCV's order, which depends on the lens: `k` holds k1 k2 p1 p2 or k1 k2 k3 k4.
    is_vector: bool,
}

/// Names of `camera_model`, of COLMAP, nerfstudio, Metashape, OpenSfM and others.
const PROJECTIONS: [(Projection, &[&str]); 4] = [
    (
        Projection::Perspective,
        &[
            "PINHOLE",
            "SIMPLE_PINHOLE",
            "PERSPECTIVE",
            "OPENCV",
            "SIMPLE_RADIAL",
            "RADIAL",
            "FULL_OPENCV",
            "BROWN",
            "BROWN_CONRADY",
            "RADTAN",
            "FRAME",
        ],
    ),
    (
        Projection::Fisheye,
        &[
            "OPENCV_FISHEYE",
            "RADIAL_FISHEYE",
            "SIMPLE_RADIAL_FISHEYE",
            "FISHEYE",
            "FISHEYE_OPENCV",
            "EQUIDISTANT",
            "KANNALA_BRANDT",
            "KANNALABRANDT4",
        ],
    ),
    (
        Projection::Equirectangular,
        &["EQUIRECTANGULAR", "SPHERICAL", "LATLONG", "PANORAMA", "PANORAMIC", "360"],
    ),
    (Projection::Orthographic, &["ORTHOGRAPHIC", "ORTHOPHOTO", "ORTHO"]),
];

const UNDISTORTED: [&str; 2] = ["PINHOLE", "SIMPLE_PINHOLE"];

/// Lenses that are not modelled, by a part of their name, and why.
const REFUSED: [(&str, &str); 9] = [
    ("THIN_PRISM", "its thin-prism terms are not modelled"),
    ("FISHEYE624", "its twelve coefficients are not modelled"),
    ("VR180", "its two eyes see from different points"),
    ("OMNIDIRECTIONALSTEREO", "every column of the image sees from another point"),
    ("FOV", "its arctangent distortion is not modelled"),
    ("FTHETA", "its polynomial is not modelled"),
    ("DIVISION", "its division model is not modelled"),
    ("DOUBLE_SPHERE", "its two spheres are not modelled"),
    ("CYLINDRICAL", "its projection is not modelled"),
];

const ADVICE: &str =
    "undistort the images to PINHOLE, for example with COLMAP's image_undistorter, and use those cameras";

impl StatedLens {
    pub(super) fn read(fields: Fields, owner: &str, notes: &mut Notes) -> Result<Self> {
        refuse_terms(fields)?;
        let model = model(fields)?;
        let by_flag = flag(fields)?;
        let fisheye = fields.flag("is_fisheye")?;
        let projection = match (model, by_flag, fisheye) {
            (Some((name, model)), Some((key, other)), _) if model != other => {
                bail!("`{key}` contradicts `camera_model`, found {name}; keep the one that is right")
            }
            (Some((name, model)), _, Some(true)) if model != Projection::Fisheye => {
                bail!("`is_fisheye` contradicts `camera_model`, found {name}; keep the one that is right")
            }
            (Some((_, Projection::Fisheye)), _, Some(false)) => {
                let message = "`is_fisheye` is false although `camera_model` is a fisheye; the model counts";
                notes.frame(Severity::Warning, owner, message);
                Some(Projection::Fisheye)
            }
            (Some((_, model)), ..) => Some(model),
            (None, Some((_, projection)), _) => Some(projection),
            (None, None, Some(true)) => Some(Projection::Fisheye),
            (None, None, Some(false)) => Some(Projection::Perspective),
            (None, None, None) => None,
        };
        let name = model.map(|(name, _)| name);
        let undistorted = name.filter(|name| UNDISTORTED.contains(name));
        Ok(Self { projection, undistorted, coefficients: coefficients(fields, name)? })
    }
}

/// The lens of the first object that names a projection, with the coefficients of the first that has any.
pub(super) fn resolve<'a>(
    layers: impl Iterator<Item = &'a StatedLens> + Clone,
    owner: &str,
    notes: &mut Notes,
) -> Lens {
    let named = layers.clone().find(|stated| stated.projection.is_some());
    let projection = named.and_then(|stated| stated.projection).unwrap_or(Projection::Perspective);
    let mut layers = layers;
    let Coefficients { k, p, is_vector } = layers.find_map(|stated| stated.coefficients).unwrap_or_default();
    let mut warn = |message: &str| notes.frame(Severity::Warning, owner, message);
    match projection {
        Projection::Perspective => {
            let (k, p) = if is_vector { ([k[0], k[1], 0.0, 0.0], [k[2], k[3]]) } else { (k, p) };
            if k == [0.0; 4] && p == [0.0; 2] {
                return Lens::Pinhole;
            }
            if named.is_some_and(|stated| stated.undistorted.is_some()) {
                warn("`camera_model` promises no distortion but there are coefficients; they are used");
            }
            Lens::OpenCv { k, p }
        }
        Projection::Fisheye => {
            if p != [0.0; 2] {
                warn("`p1` and `p2` of a fisheye lens are not modelled and ignored");
            }
            Lens::Fisheye { k }
        }
        Projection::Equirectangular => Lens::Equirectangular,
        Projection::Orthographic => {
            if k != [0.0; 4] || p != [0.0; 2] {
                warn("distortion of an orthographic camera is not modelled and ignored");
            }
            Lens::Orthographic
        }
    }
}

/// What `camera_model` names. `camera_type` is looked at too, which may hold anything.
fn model(fields: Fields) -> Result<Option<(&'static str, Projection)>> {
    if let Some(name) = fields.text("camera_model")? {
        let plain = plain(name);
        if let Some(known) = known(&plain) {
            return Ok(Some(known));
        }
        if let Some((_, reason)) = REFUSED.iter().find(|(part, _)| plain.contains(part)) {
            bail!("`camera_model` {} cannot be used: {reason}; {ADVICE}", shortened(name));
        }
        let names: Vec<_> = PROJECTIONS.iter().flat_map(|(_, names)| names.iter().take(4).copied()).collect();
        bail!("`camera_model` must be one of {}, found {:?}; {ADVICE}", names.join(", "), shortened(name));
    }
    let other = fields.get("camera_type").and_then(|value| value.as_str());
    Ok(other.and_then(|name| known(&plain(name))))
}

/// `CameraModel.OPENCV`, `opencv` and `OpenCV` are one.
fn plain(name: &str) -> String {
    let last = name.trim().rsplit('.').next().unwrap_or_default();
    last.to_uppercase().replace(['-', ' '], "_")
}

fn known(plain: &str) -> Option<(&'static str, Projection)> {
    PROJECTIONS.iter().find_map(|(projection, names)| {
        names.iter().find(|&&name| name == plain).map(|&name| (name, *projection))
    })
}

/// The flags of instant-ngp. Its own `equirectangular` is a cylinder of equal areas, but whoever else
/// writes the word means longitude and latitude.
fn flag(fields: Fields) -> Result<Option<(&'static str, Projection)>> {
    for (key, projection) in [
        ("latlong", Projection::Equirectangular),
        ("equirectangular", Projection::Equirectangular),
        ("orthographic", Projection::Orthographic),
    ] {
        if fields.flag(key)? == Some(true) {
            return Ok(Some((key, projection)));
        }
    }
    Ok(None)
}

fn coefficients(fields: Fields, model: Option<&str>) -> Result<Option<Coefficients>> {
    const KEYS: [&str; 6] = ["k1", "k2", "k3", "k4", "p1", "p2"];
    const OBJECTS: [&str; 3] = ["distortion_params", "distortion", "distortion_coefficients"];
    for object in std::iter::once(fields).chain(fields.objects(&OBJECTS)) {
        for key in ["k5", "k6"] {
            let value = object.number(key)?.unwrap_or(0.0);
            ensure!(value == 0.0, "`{key}` is {value}; the rational lens model is not modelled; {ADVICE}");
        }
    }
    let source =
        if fields.has(&KEYS) { Some(fields) } else { fields.objects(&OBJECTS).find(|o| o.has(&KEYS)) };
    let Some(source) = source else {
        return vector(fields);
    };
    let mut values = [0.0; 6];
    for (value, key) in values.iter_mut().zip(KEYS) {
        *value = source.number(key)?.unwrap_or(0.0);
    }
    let [k1, k2, k3, k4, p1, p2] = values;
    ensure!(
        model != Some("FULL_OPENCV") || k4 == 0.0,
        "`k4` is {k4} and divides in FULL_OPENCV; the rational lens model is not modelled; {ADVICE}"
    );
    Ok(Some(Coefficients { k: [k1, k2, k3, k4], p: [p1, p2], is_vector: false }))
}

/// Lists of coefficients: nerfstudio's order is k1 k2 k3 k4 p1 p2, OpenCV's k1 k2 p1 p2 k3.
fn vector(fields: Fields) -> Result<Option<Coefficients>> {
    const OPEN_CV: [&str; 5] =
        ["distortion", "distortion_coefficients", "dist_coeffs", "distortion_coeffs", "dist"];
    let is_list = |key: &str| fields.get(key).is_some_and(|value| value.is_array());
    if is_list("distortion_params") {
        let list = fields.numbers("distortion_params")?.unwrap_or_default();
        ensure!(
            list.len() <= 6,
            "`distortion_params` must have k1 k2 k3 k4 p1 p2, found {} numbers; {ADVICE}",
            list.len()
        );
        let at = |index: usize| list.get(index).copied().unwrap_or(0.0);
        return Ok(Some(Coefficients { k: [0, 1, 2, 3].map(at), p: [4, 5].map(at), is_vector: false }));
    }
    let Some(key) = OPEN_CV.into_iter().find(|key| is_list(key)) else {
        return Ok(None);
    };
    let list = fields.numbers(key)?.unwrap_or_default();
    let at = |index: usize| list.get(index).copied().unwrap_or(0.0);
    ensure!(
        [0, 4, 5, 8, 12, 14].contains(&list.len()) && list.iter().skip(5).all(|&term| term == 0.0),
        "`{key}` must have OpenCV's k1 k2 p1 p2 and perhaps k3, found {} numbers; {ADVICE}",
        list.len()
    );
    Ok(Some(match list.len() {
        // The lens decides what the last two are.
        4 => Coefficients { k: [0, 1, 2, 3].map(at), p: [0.0; 2], is_vector: true },
        _ => Coefficients { k: [at(0), at(1), at(4), 0.0], p: [at(2), at(3)], is_vector: false },
    }))
}

/// Terms that would bend the image if they were read.
fn refuse_terms(fields: Fields) -> Result<()> {
    ensure!(!fields.has(&["ftheta_p0"]), "f-theta lenses (`ftheta_p0`) are not modelled; {ADVICE}");
    for key in ["omega", "s1", "s2", "s3", "s4"] {
        // Other tools may mean something else by so short a name.
        let value = fields.get(key).and_then(serde_json::Value::as_f64).unwrap_or(0.0);
        ensure!(value == 0.0, "`{key}` is {value}; this term of the lens is not modelled; {ADVICE}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::dataset::transforms::tests::one;
    use serde_json::{Value, json};

    /// The lens of one frame, and what is said about it.
    fn read(frame: Value, mut file: Value) -> (Lens, String) {
        file["fl_x"] = json!(9);
        let listing = one(frame, file);
        let entry = &listing.frames[0];
        let lens = entry.intrinsics.camera([8, 8], entry.world_from_camera).0.lens;
        (lens, listing.notes().iter().map(ToString::to_string).collect())
    }

    const fn open_cv(k: [f64; 4], p: [f64; 2]) -> Lens {
        Lens::OpenCv { k, p }
    }

    #[test]
    fn names_are_synonyms_in_any_spelling() {
        for (projection, names) in PROJECTIONS {
            let expected = match projection {
                Projection::Perspective => Lens::Pinhole,
                Projection::Fisheye => Lens::Fisheye { k: [0.0; 4] },
                Projection::Equirectangular => Lens::Equirectangular,
                Projection::Orthographic => Lens::Orthographic,
            };
            for name in names {
                for spelling in [(*name).to_owned(), name.to_lowercase(), format!("CameraModel.{name}")] {
                    let found = read(json!({}), json!({"camera_model": spelling, "k1": 0})).0;
                    assert_eq!(found, expected, "{spelling}");
                }
            }
        }
        assert_eq!(read(json!({}), json!({"camera_type": "spherical"})).0, Lens::Equirectangular);
        assert_eq!(read(json!({}), json!({"camera_type": "iPhone 12"})).0, Lens::Pinhole);
    }

    #[test]
    fn coefficients_never_share_slots() {
        let lens = |file: Value| read(json!({}), file).0;
        assert_eq!(lens(json!({"k3": 0.3, "k4": 0.4})), open_cv([0.0, 0.0, 0.3, 0.4], [0.0; 2]));
        assert_eq!(lens(json!({"p1": 0.3, "p2": 0.4})), open_cv([0.0; 4], [0.3, 0.4]));
        assert_eq!(lens(json!({"k1": "0.1", "p2": "-4"})), open_cv([0.1, 0.0, 0.0, 0.0], [0.0, -4.0]));
        let nerfstudio = json!({"distortion_params": [1, 2, 3, 4, 5, 6]});
        assert_eq!(lens(nerfstudio), open_cv([1.0, 2.0, 3.0, 4.0], [5.0, 6.0]));
        let five = json!({"dist_coeffs": [[1, 2, 3, 4, 5]]});
        assert_eq!(lens(five), open_cv([1.0, 2.0, 5.0, 0.0], [3.0, 4.0]));
        assert_eq!(lens(json!({"distortion": [1, 2, 3, 4]})), open_cv([1.0, 2.0, 0.0, 0.0], [3.0, 4.0]));
        assert_eq!(lens(json!({"distortion": {"k2": 2}})), open_cv([0.0, 2.0, 0.0, 0.0], [0.0; 2]));
        let fisheye = json!({"is_fisheye": true, "distortion": [1, 2, 3, 4]});
        assert_eq!(lens(fisheye), Lens::Fisheye { k: [1.0, 2.0, 3.0, 4.0] });
    }

    #[test]
    fn the_frame_goes_before_the_file() {
        let file = || json!({"camera_model": "OPENCV_FISHEYE", "k1": 0.1, "k2": 0.2});
        assert_eq!(read(json!({}), file()).0, Lens::Fisheye { k: [0.1, 0.2, 0.0, 0.0] });
        let frame = json!({"camera_model": "OPENCV", "k1": 0.5});
        assert_eq!(read(frame, file()).0, open_cv([0.5, 0.0, 0.0, 0.0], [0.0; 2]));
        let frame = json!({"is_fisheye": true, "k1": 0});
        assert_eq!(read(frame, json!({"k1": 1})).0, Lens::Fisheye { k: [0.0; 4] });
    }

    #[test]
    fn contradictions_that_can_be_read_are_reported() {
        let (lens, said) = read(json!({}), json!({"camera_model": "PINHOLE", "k1": 0.1}));
        assert_eq!(lens, open_cv([0.1, 0.0, 0.0, 0.0], [0.0; 2]));
        assert!(said.contains("promises no distortion"), "{said}");
        let (_, said) = read(json!({}), json!({"camera_model": "FISHEYE", "is_fisheye": false, "p1": 0.1}));
        assert!(said.contains("the model counts") && said.contains("not modelled and ignored"), "{said}");
        assert_eq!(read(json!({}), json!({"camera_model": "OPENCV", "k1": 0.1})).1, "");
    }
}
