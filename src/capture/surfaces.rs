//! Where the surfaces of a scene are, from files that tell: the point cloud that a dataset names, or depth.

use std::path::Path;

use anyhow::{Result, ensure};
use glam::DVec3;

use super::point_cloud;
use crate::camera::Camera;
use crate::support::format::percent;

/// Fewer points than this tell nothing.
const LEAST_POINTS: usize = 50;
/// Cameras and points that are compared.
const COMPARED: usize = 200;
/// The least part of a cloud that is in somebody's picture, and of the cameras that have some of it in theirs.
const LEAST_SEEN: f64 = 0.5;
/// Parts of the points below and above what most lie within, along each axis.
const STRAY: f64 = 0.02;
/// The part of the points beyond what all but mistakes lie within.
const LOST: f64 = 0.002;

/// Points on the surfaces of a scene.
#[derive(Clone, Debug)]
pub(super) struct Surfaces {
    /// In world space.
    points: Vec<DVec3>,
    /// Where they are from, after "around".
    pub(super) source: String,
}

/// A cube around most of the surfaces, and how far the others reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    pub(super) center: DVec3,
    /// Half the side of the cube.
    pub(super) half: f64,
    /// Half the side of one that holds nearly all.
    pub(super) reach: f64,
}

impl Surfaces {
    /// The points of a file that `cameras` look at.
    ///
    /// # Errors
    /// When it cannot be read, or it is not where the cameras look.
    pub(super) fn of_cloud(path: &Path, cameras: &[&Camera]) -> Result<Self> {
        let points = point_cloud::positions(path)?;
        let show = path.display();
        ensure!(points.len() >= LEAST_POINTS, "{show} has {} points, too few to tell", points.len());
        let (some, cameras) = (spread(&points), spread(cameras));
        let part = |seen: usize, all: usize| seen as f64 / all as f64;
        let is_seen = |point: DVec3| cameras.iter().any(|camera| camera.has_in_picture(point));
        let seen = part(some.iter().filter(|&&&point| is_seen(point)).count(), some.len());
        let sees = |camera: &Camera| some.iter().any(|&&point| camera.has_in_picture(point));
        let seeing = part(cameras.iter().filter(|camera| sees(camera)).count(), cameras.len());
        ensure!(
            seen >= LEAST_SEEN && seeing >= LEAST_SEEN,
            "{} of the points of {show} are in a picture, and {} of the cameras see some of them; it is perhaps in other \
             coordinates than the poses",
            percent(seen),
            percent(seeing)
        );
        Ok(Self { points, source: format!("the points of {show}") })
    }

    /// Places in world space that depth files show; `None` of too few.
    pub(super) fn of_depth(points: Vec<DVec3>) -> Option<Self> {
        let source = "what the depth files show".to_owned();
        (points.len() >= LEAST_POINTS).then_some(Self { points, source })
    }

    /// Where most of them are; `None` where they are all at one place.
    pub(super) fn extent(&self) -> Option<Extent> {
        let along = |axis: usize| {
            let mut values: Vec<f64> = self.points.iter().map(|point| point[axis]).collect();
            [quantile(&mut values, STRAY), quantile(&mut values, 1.0 - STRAY)]
        };
        let [x, y, z] = [0, 1, 2].map(along);
        let [low, high] = [0, 1].map(|end| DVec3::new(x[end], y[end], z[end]));
        let center = 0.5 * (low + high);
        let half = 0.5 * (high - low).max_element();
        let mut away: Vec<f64> =
            self.points.iter().map(|point| (*point - center).abs().max_element()).collect();
        let reach = quantile(&mut away, 1.0 - LOST);
        (half > 0.0 && half.is_finite() && reach.is_finite()).then_some(Extent { center, half, reach })
    }
}

/// Some of many, evenly spaced.
fn spread<T>(items: &[T]) -> Vec<&T> {
    items.iter().step_by(items.len().div_ceil(COMPARED).max(1)).collect()
}

/// The value that a part of the others is below.
fn quantile(values: &mut [f64], part: f64) -> f64 {
    let index = (part * (values.len() - 1) as f64).round() as usize;
    *values.select_nth_unstable_by(index, f64::total_cmp).1
}
