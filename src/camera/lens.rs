//! Lens models: which direction of the camera a point of the image shows, and back.
//!
//! Points of the image are given on the normalised image plane, `(pixel - center_px) / focal_px`, +x right
//! and +y down. Points and directions of the camera are in its axes: +X right, +Y up, the view along -Z.

use super::{Camera, equirectangular, fisheye, open_cv};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// How a camera maps directions to its image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Lens {
    /// No distortion.
    #[default]
    Pinhole,
    /// OpenCV's radial-tangential model:
    /// `x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸) + 2 p1 x y + p2 (r² + 2 x²)` and
    /// `y_d = y (1 + …) + p1 (r² + 2 y²) + 2 p2 x y`, with y pointing down.
    OpenCv {
        /// Radial coefficients k1..k4.
        k: [f64; 4],
        /// Tangential coefficients p1, p2.
        p: [f64; 2],
    },
    /// OpenCV's fisheye: a ray at the angle θ from the view axis is imaged at the distance
    /// `θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)` from the principal point.
    Fisheye {
        /// Coefficients k1..k4.
        k: [f64; 4],
    },
    /// Parallel rays, which start on the image plane; `focal_px` is pixels per world unit.
    Orthographic,
    /// Longitude to the right and latitude upwards, the view axis in the middle; `focal_px` is pixels per radian.
    Equirectangular,
}

/// The model of a lens, without its coefficients.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LensKind {
    /// [`Lens::Pinhole`].
    Pinhole,
    /// [`Lens::OpenCv`].
    OpenCv,
    /// [`Lens::Fisheye`].
    Fisheye,
    /// [`Lens::Orthographic`].
    Orthographic,
    /// [`Lens::Equirectangular`].
    Equirectangular,
}

/// What the image of a lens is laid out by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Geometry {
    /// A plane at distance 1, up to distortion: what is twice as far away is half as large, and nothing beside or behind
    /// the camera is seen.
    Plane,
    /// Angles: the lens sees sideways and behind.
    Angles,
    /// Parallel rays: sizes do not depend on distances.
    Parallel,
}

/// A ray in the camera's axes; lengths are in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LensRay {
    /// Where it starts, seen from the camera's position.
    pub(super) offset: DVec3,
    /// Its direction, of any length but 0.
    pub(super) direction: DVec3,
}

impl LensKind {
    /// All models.
    pub const ALL: [Self; 5] =
        [Self::Pinhole, Self::OpenCv, Self::Fisheye, Self::Orthographic, Self::Equirectangular];

    /// The models that `cameras` have.
    #[must_use]
    pub fn among<'a>(cameras: impl IntoIterator<Item = &'a Camera>) -> BTreeSet<Self> {
        cameras.into_iter().map(|camera| camera.lens.kind()).collect()
    }

    /// What the model is called.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pinhole => "pinhole",
            Self::OpenCv => "OpenCV",
            Self::Fisheye => "fisheye",
            Self::Orthographic => "orthographic",
            Self::Equirectangular => "equirectangular",
        }
    }

    /// What it does, in a line.
    #[must_use]
    pub const fn description(self) -> &'static str {
        match self {
            Self::Pinhole => "No distortion",
            Self::OpenCv => "Radial and tangential distortion",
            Self::Fisheye => "OpenCV's fisheye, 180 degrees across the diagonal",
            Self::Orthographic => "Parallel rays",
            Self::Equirectangular => "The whole sphere, for images twice as wide as high",
        }
    }

    /// What its image is laid out by.
    #[must_use]
    pub const fn geometry(self) -> Geometry {
        match self {
            Self::Pinhole | Self::OpenCv => Geometry::Plane,
            Self::Fisheye | Self::Equirectangular => Geometry::Angles,
            Self::Orthographic => Geometry::Parallel,
        }
    }

    /// What depth means behind such a lens, wherever a depth is given: the distance along the ray for a lens that
    /// sees sideways and behind (fisheye, equirectangular), the distance along the view axis otherwise.
    #[must_use]
    pub const fn depth_is_distance(self) -> bool {
        matches!(self.geometry(), Geometry::Angles)
    }
}

impl Lens {
    /// Which model it is.
    #[must_use]
    pub const fn kind(&self) -> LensKind {
        match self {
            Self::Pinhole => LensKind::Pinhole,
            Self::OpenCv { .. } => LensKind::OpenCv,
            Self::Fisheye { .. } => LensKind::Fisheye,
            Self::Orthographic => LensKind::Orthographic,
            Self::Equirectangular => LensKind::Equirectangular,
        }
    }

    /// As [`LensKind::depth_is_distance`].
    #[must_use]
    pub const fn depth_is_distance(&self) -> bool {
        self.kind().depth_is_distance()
    }

    /// What its image is laid out by.
    #[must_use]
    pub const fn geometry(&self) -> Geometry {
        self.kind().geometry()
    }

    /// Radial and tangential coefficients; 0 for what a lens does not have.
    #[must_use]
    pub const fn coefficients(&self) -> ([f64; 4], [f64; 2]) {
        match *self {
            Self::OpenCv { k, p } => (k, p),
            Self::Fisheye { k } => (k, [0.0; 2]),
            Self::Pinhole | Self::Orthographic | Self::Equirectangular => ([0.0; 4], [0.0; 2]),
        }
    }

    /// Where the polynomial of a lens stops growing, beyond which nothing is imaged: for a fisheye the angle to the
    /// view axis in radians, at most π; for OpenCV's model the largest undistorted distance from the principal point
    /// (with tangential terms, in the direction where it is smallest). `None` for other lenses.
    #[must_use]
    pub fn rim(&self) -> Option<f64> {
        match self {
            Self::OpenCv { k, p } => Some(open_cv::rim(k, p)),
            Self::Fisheye { k } => Some(fisheye::rim(k)),
            Self::Pinhole | Self::Orthographic | Self::Equirectangular => None,
        }
    }

    /// The most that the image of a direction moves on the plane per radian that the direction turns, anywhere within
    /// the angle `spread` of `point`, which is imaged at `plane`. `None` at the rim, where the image wraps around, for
    /// wide spreads, and for lenses whose image is not one of angles.
    pub(super) fn stretch(&self, plane: DVec2, point: DVec3, spread: f64) -> Option<f64> {
        match self {
            Self::Fisheye { k } => fisheye::stretch(k, point, spread),
            Self::Equirectangular => equirectangular::stretch(plane, spread),
            Self::Pinhole | Self::OpenCv { .. } | Self::Orthographic => None,
        }
    }

    /// The ray that is imaged at `plane`, or `None` where the lens images none.
    pub(super) fn ray(&self, plane: DVec2) -> Option<LensRay> {
        let flat = |at: DVec2| DVec3::new(at.x, -at.y, -1.0);
        let (offset, direction) = match self {
            Self::Pinhole => (DVec3::ZERO, flat(plane)),
            Self::OpenCv { k, p } => (DVec3::ZERO, flat(open_cv::undistort(k, p, plane)?)),
            Self::Fisheye { k } => (DVec3::ZERO, fisheye::direction(k, plane)?),
            Self::Orthographic => (DVec3::new(plane.x, -plane.y, 0.0), DVec3::NEG_Z),
            Self::Equirectangular => (DVec3::ZERO, equirectangular::direction(plane)?),
        };
        Some(LensRay { offset, direction })
    }

    /// Where a point of the camera's axes is imaged, and its depth in world units as
    /// [`Lens::depth_is_distance`] defines it; `None` where the lens does not see it.
    pub(super) fn image(&self, point: DVec3) -> Option<(DVec2, f64)> {
        let depth = if self.depth_is_distance() { point.length() } else { -point.z };
        if depth.is_nan() || depth <= 0.0 {
            return None;
        }
        let across = DVec2::new(point.x, -point.y);
        let plane = match self {
            Self::Pinhole => across / depth,
            Self::OpenCv { k, p } => open_cv::image(k, p, across / depth)?,
            Self::Fisheye { k } => fisheye::image(k, point)?,
            Self::Orthographic => across,
            Self::Equirectangular => equirectangular::image(point),
        };
        Some((plane, depth))
    }
}
