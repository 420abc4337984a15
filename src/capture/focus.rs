//! Where a set of cameras looks, from their optical axes alone.

use glam::{DMat3, DVec2, DVec3};

use crate::camera::{Camera, Geometry};
use crate::support::statistics;

/// What matters about a camera here, in world space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OpticalAxis {
    pub(crate) origin: DVec3,
    /// Unit direction through the middle of the image.
    pub(crate) direction: DVec3,
    /// Half the larger side of the view at the camera itself, in world units; 0 but for parallel rays.
    half_width: f64,
    /// Tangent of half the larger field of view.
    tan_half: f64,
}

/// A lens that sees more to the side than this is not pointed at all it sees.
const WIDEST_TANGENT: f64 = 1.0;

impl OpticalAxis {
    pub(crate) fn of(camera: &Camera) -> Self {
        let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
        let middle = camera.ray(0.5 * size);
        let half = (0.5 * size / camera.focal_px).max_element();
        let geometry = camera.lens.geometry();
        Self {
            origin: camera.position(),
            direction: middle.map_or(camera.forward(), |ray| ray.direction),
            half_width: if geometry == Geometry::Parallel { half } else { 0.0 },
            tan_half: match geometry {
                Geometry::Plane => half,
                Geometry::Parallel => 0.0,
                Geometry::Angles => half.min(WIDEST_TANGENT.atan()).tan(),
            },
        }
    }

    /// A bare axis along a unit direction, with a right angle of view.
    pub(crate) fn along(origin: DVec3, direction: DVec3) -> Self {
        Self { origin, direction, half_width: 0.0, tan_half: 1.0 }
    }

    /// Half the larger side of the view at a distance, in world units.
    pub(crate) fn half_width_at(&self, distance: f64) -> f64 {
        self.half_width + distance * self.tan_half
    }

    /// Distance along the axis, and away from it.
    pub(crate) fn along_and_across(&self, point: DVec3) -> (f64, f64) {
        let to_point = point - self.origin;
        let along = to_point.dot(self.direction);
        (along, (to_point - along * self.direction).length())
    }

    pub(crate) fn sees(&self, point: DVec3) -> bool {
        let (along, across) = self.along_and_across(point);
        along > 0.0 && across <= self.half_width_at(along)
    }
}

/// Mean of the directions of cameras that look one way, up to 20 degrees to each side, and do not pan.
const ONE_WAY: f64 = 0.98;

/// Cameras that move along their axes see at least this part of their way ahead.
const PART_OF_WAY: f64 = 1.0 / 16.0;

/// The point a set of cameras looks at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Focus {
    pub(crate) point: DVec3,
    /// Typical distance between a camera and what it looks at, above 0.
    pub(crate) distance: f64,
    pub(crate) kind: FocusKind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FocusKind {
    /// The axes meet.
    Crossing,
    /// The axes do not tell, but the world's origin is in view.
    Origin,
    /// The axes do not tell: a point ahead of the cameras.
    Ahead,
    /// The cameras look outwards or past each other: the middle of the cameras.
    Inside,
}

/// Finds the focus of at least one axis.
pub(crate) fn find(axes: &[OpticalAxis]) -> Focus {
    let mean = axes.iter().map(|axis| axis.origin).sum::<DVec3>() / axes.len() as f64;
    let spread = axes.iter().map(|axis| axis.origin.distance(mean));
    let spread = spread.fold(0.0, f64::max);
    let heading = axes.iter().map(|axis| axis.direction).sum::<DVec3>() / axes.len() as f64;
    if let Some(crossing) = crossing(axes, mean, spread) {
        return crossing;
    }
    if heading.length() > ONE_WAY {
        return ahead(axes, mean, heading.normalize());
    }
    let point = DVec3::from_array(std::array::from_fn(|i| median(axes.iter().map(|axis| axis.origin[i]))));
    let distance = median(axes.iter().map(|axis| axis.origin.distance(point)));
    let known = [distance, spread, mean.length(), 1.0];
    Focus { point, distance: known.into_iter().find(|&d| d > 0.0).unwrap_or(1.0), kind: FocusKind::Inside }
}

/// The projection onto the plane across a direction; a sum over axes finds the point nearest to all.
fn across(direction: DVec3) -> DMat3 {
    let outer = DMat3::from_cols(direction * direction.x, direction * direction.y, direction * direction.z);
    DMat3::IDENTITY - outer
}

/// Axes within a fraction of a degree say nothing about where they meet.
fn are_parallel(axes: &[OpticalAxis]) -> bool {
    let sum: DMat3 = axes.iter().map(|axis| across(axis.direction)).sum();
    (sum * (axes.len() as f64).recip()).determinant() < 1e-5
}

/// The least-squares crossing of the axes, with axes that miss it or point away from it counting less
/// and less; `None` where most do.
fn crossing(axes: &[OpticalAxis], mean: DVec3, spread: f64) -> Option<Focus> {
    if are_parallel(axes) || spread == 0.0 {
        return None;
    }
    let mut weights = vec![1.0; axes.len()];
    let mut point = mean;
    for _ in 0..30 {
        let mut matrix = DMat3::ZERO;
        let mut target = DVec3::ZERO;
        for (axis, &weight) in axes.iter().zip(&weights) {
            let across = weight * across(axis.direction);
            matrix += across;
            // Relative to the mean, or large coordinates would eat the digits.
            target += across * ((axis.origin - mean) / spread);
        }
        let total: f64 = weights.iter().sum();
        matrix *= total.recip();
        if matrix.determinant().is_nan() || matrix.determinant() < 1e-6 {
            return None;
        }
        point = mean + spread * (matrix.inverse() * (target / total));
        let misses = axes.iter().map(|axis| axis.along_and_across(point).1);
        let tolerance = median(misses).max(1e-6 * spread);
        for (axis, weight) in axes.iter().zip(&mut weights) {
            let (along, miss) = axis.along_and_across(point);
            let behind = if along > 0.0 { 1.0 } else { 0.1 };
            *weight = behind / (1.0 + (miss / (2.0 * tolerance)).powi(2));
        }
    }
    let views = axes.iter().map(|axis| axis.along_and_across(point));
    let looking = views.filter(|&(along, miss)| along > 0.0 && miss < along);
    let distance = median(axes.iter().map(|axis| axis.origin.distance(point)));
    (looking.count() * 10 >= axes.len() * 6 && distance > 0.0).then_some(Focus {
        point,
        distance,
        kind: FocusKind::Crossing,
    })
}

/// A single axis, parallel ones, or ones that fan out.
fn ahead(axes: &[OpticalAxis], mean: DVec3, heading: DVec3) -> Focus {
    let seeing = axes.iter().filter(|axis| axis.sees(DVec3::ZERO)).count();
    if seeing * 10 >= axes.len() * 8 {
        // Renderers put the object at the origin.
        let distance = -mean.dot(heading);
        return Focus { point: mean + distance * heading, distance, kind: FocusKind::Origin };
    }
    let away = |axis: &OpticalAxis| (across(heading) * (axis.origin - mean)).length();
    let reach = axes.iter().map(away).fold(0.0, f64::max);
    let way = axes.iter().map(|axis| (axis.origin - mean).dot(heading).abs()).fold(0.0, f64::max);
    // Where the view of each camera reaches over all the others; a single camera has no such distance,
    // and its distance from the origin is the only length there is.
    let from_views = median(axes.iter().map(|axis| (2.0 * reach - axis.half_width) / axis.tan_half));
    let lengths = [from_views.max(PART_OF_WAY * way), mean.length(), 1.0];
    let single = reach.max(way) <= 1e-9 * mean.length();
    let usable = lengths.into_iter().skip(usize::from(single));
    let distance = { usable }.find(|&d| d > 0.0 && d.is_finite()).unwrap_or(1.0);
    Focus { point: mean + distance * heading, distance, kind: FocusKind::Ahead }
}

/// The middle value, the upper one of two; not a number for none.
pub(crate) fn median(values: impl Iterator<Item = f64>) -> f64 {
    statistics::median(values).unwrap_or(f64::NAN)
}
